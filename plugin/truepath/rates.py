r"""Speed and acceleration of the joints along a program's motions, before and after its correction.

A controller plans its own motion between two targets; a program states only what it shall keep. So each figure here
is one that the controller cannot do without if it keeps what is stated: a limit that is passed, is passed. Motions may
be faster than that, where blends join them.

- Motions of the joints in step: the leading joint takes the stated speed and acceleration (its speed only as far as
  the way allows from rest to rest, :math:`\sqrt{a d}`), every other joint its share. With a stated time the mean
  speed, which the fastest moment reaches at least; nothing is said of acceleration.
- Motions of the tool along a line or an arc: a trapezoid from rest to rest, :math:`\dot s = \min(v, \sqrt{2 a s},
  \sqrt{2 a (L - s)})`. Then :math:`\dot q = q' \dot s` and :math:`\ddot q = q'' \dot s^2 + q' \ddot s`, with the
  derivatives of the sampled joints by differences. With a stated time, constant speed. Near a singularity q' grows,
  and that is what this is for. A tool that turns on the spot takes its time too, see ``TURN_RAD_PER_M``.
- Joints at a fixed rate: differences over the stated time.

S motions of K samples, at equal steps along the way, first and last sample being the ends. What a program does not
state is NaN; what cannot be judged for want of it is NaN in the answer and never a finding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from truepath.guards import Finding
from truepath.lie import Array
from truepath.robot import NominalRobot

# A turning tool: "angular velocity is derived from linear velocity, AngVel = 4 * LinVel, rad/s", and the slower of the
# two decides (a Universal Robots engineer, forum.universal-robots.com/t/movel-tool-angular-speed/15912).
TURN_RAD_PER_M = 4.0
SHORTEST_M = 1e-5  # of a way that is judged: the tool stands still on less
ROUNDING = 1e-6  # share of a limit: one written with few decimals is still that limit


@dataclass(frozen=True, eq=False)
class Rates:
    """Highest joint speeds ``(S, n)``, rad/s, and accelerations ``(S, n)``, rad/s^2, of S motions; NaN: not known."""

    speed: Array
    acceleration: Array


def joint_motions(q_rad: Array, speed: Array, acceleration: Array, time_s: Array) -> Rates:
    """All joints in step (``Kind.JOINT``).

    Args:
        q_rad: ``(S, K, n)``; only the ends count.
        speed, acceleration: ``(S,)`` of the leading joint, rad/s and rad/s^2.
        time_s: ``(S,)``; where it is stated, the speed does not count.
    """
    way = np.abs(q_rad[:, -1] - q_rad[:, 0])
    lead = way.max(axis=1)
    moves = lead > 0
    share = np.divide(way, lead[:, None], out=np.zeros_like(way), where=moves[:, None])
    timed = ~np.isnan(time_s)
    peak = np.fmin(speed, np.sqrt(acceleration * lead))  # fmin: what is not stated does not bound
    peak = np.where(np.isnan(speed), np.nan, peak)
    peak = np.where(timed, _quotient(lead, time_s), peak)
    acceleration = np.where(timed, np.nan, acceleration)
    return Rates(share * peak[:, None], share * acceleration[:, None])


def tool_motions(
    q_rad: Array, length_m: Array, turn_rad: Array, speed: Array, acceleration: Array, time_s: Array
) -> Rates:
    """The tool along a line or an arc (``Kind.LINEAR``, ``PROCESS``, ``ARC``).

    Args:
        q_rad: ``(S, K, n)`` with K >= 3; where the joints are at equal steps of the way.
        length_m: ``(S,)`` way of the tool.
        turn_rad: ``(S,)`` angle by which it turns.
        speed, acceleration: ``(S,)`` of the tool, m/s and m/s^2.
        time_s: ``(S,)``; where it is stated, speed and acceleration do not count.
    """
    K = q_rad.shape[1]
    if K < 3:
        raise ValueError(f"a motion of {K} samples has no curvature; give three or more")
    way = np.maximum(length_m, turn_rad / TURN_RAD_PER_M)
    way = np.where(way > SHORTEST_M, way, np.nan)
    timed = ~np.isnan(time_s)
    speed = np.where(timed, _quotient(way, time_s), speed)
    acceleration = np.where(timed, np.nan, acceleration)

    step = (way / (K - 1))[:, None, None]
    slope = np.diff(q_rad, axis=1) / step  # (S, K - 1, n) dq/ds between samples
    pace, _ = _trapezoid((np.arange(K - 1) + 0.5) / (K - 1), way, speed, acceleration)
    joint_speed = np.abs(slope) * pace[..., None]

    curvature = np.diff(slope, axis=1) / step  # (S, K - 2, n) at the inner samples
    slope_there = 0.5 * (slope[:, 1:] + slope[:, :-1])
    pace, gain = _trapezoid(np.arange(1, K - 1) / (K - 1), way, speed, acceleration)
    joint_acceleration = np.abs(curvature * (pace**2)[..., None] + slope_there * gain[..., None])
    return Rates(joint_speed.max(axis=1), joint_acceleration.max(axis=1))


def servo_motions(q_rad: Array, time_s: Array) -> Rates:
    """Joints at a fixed rate (``Kind.SERVO``).

    Args:
        q_rad: ``(S, K, n)``; only the ends count. A motion that starts where the one before it ended, both in this
            array, is its continuation; only these have an acceleration.
        time_s: ``(S,)`` from one target to the next.
    """
    velocity = _quotient(q_rad[:, -1] - q_rad[:, 0], time_s[:, None])
    acceleration = np.full_like(velocity, np.nan)
    follows = (q_rad[1:, 0] == q_rad[:-1, -1]).all(axis=1)
    # From the middle of one step to the middle of the next.
    change = _quotient(np.diff(velocity, axis=0), 0.5 * (time_s[1:] + time_s[:-1])[:, None])
    acceleration[1:][follows] = np.abs(change[follows])
    return Rates(np.abs(velocity), acceleration)


def rate_findings(before: Rates, after: Rates, robot: NominalRobot, line: Array) -> list[Finding]:
    """One finding for each motion and limit that is passed, about the joint that passes it furthest.

    An error where the correction makes a joint pass its speed; a warning where the program makes it pass by itself, and
    for accelerations, of which makers seldom state a limit: what a model holds is a planner's habit.

    Args:
        before, after: of the same S motions with programmed and with corrected joints.
        robot: for the limits; infinite ones are none.
        line: ``(S,)`` of the target of each motion.
    """
    return [
        *_passed(before.speed, after.speed, robot.velocity_rad_s, "joint-speed", "rad/s", robot, line),
        *_passed(
            before.acceleration,
            after.acceleration,
            robot.acceleration_rad_s2,
            "joint-acceleration",
            "rad/s^2",
            robot,
            line,
        ),
    ]


def _passed(
    before: Array, after: Array, limit: Array, guard: str, unit: str, robot: NominalRobot, line: Array
) -> list[Finding]:
    """For figures ``(S, n)`` before and after, and limits ``(n,)``."""
    most = limit * (1 + ROUNDING)
    by_itself = before > most  # NaN passes nothing
    by_correction = (after > most) & ~by_itself
    # What the correction does is told first; else the joint that is furthest beyond.
    passing = np.where(by_correction, after, np.where(by_itself, before, 0.0))
    weight = passing / np.maximum(limit, 1e-12) + 1e15 * by_correction
    findings = []
    for s in np.flatnonzero((by_correction | by_itself).any(axis=1)):
        i = int(np.argmax(weight[s]))
        name, was, now, most_i = robot.joint_names[i], float(before[s, i]), float(after[s, i]), float(limit[i])
        what = f"q{i + 1} ({name}): {guard.removeprefix('joint-')}"
        if by_correction[s, i]:
            message = f"{what} {now:.3g} {unit} after the correction, {was:.3g} before; its limit is {most_i:.3g}"
            level: Literal["error", "warning"] = "error" if guard == "joint-speed" else "warning"
            findings.append(Finding(level, guard, int(line[s]), message, now, most_i, unit))
        else:
            message = f"{what} {was:.3g} {unit} in the program itself, {now:.3g} corrected; its limit is {most_i:.3g}"
            findings.append(Finding("warning", guard, int(line[s]), message, was, most_i, unit))
    return findings


def _trapezoid(share: Array, way: Array, speed: Array, acceleration: Array) -> tuple[Array, Array]:
    """Pace ``(S, k)`` and its rate of change at shares ``(k,)`` of ways ``(S,)``; without acceleration constant."""
    gone = share * way[:, None]
    left = way[:, None] - gone
    starting = np.sqrt(2 * acceleration[:, None] * gone)
    stopping = np.sqrt(2 * acceleration[:, None] * left)
    cruise = np.broadcast_to(speed[:, None], gone.shape)
    pace = np.where(np.isnan(cruise), np.nan, np.fmin(cruise, np.fmin(starting, stopping)))
    ramp = np.fmin(starting, stopping) < cruise
    gain = np.where(ramp, np.where(gone < left, acceleration[:, None], -acceleration[:, None]), 0.0)
    return pace, gain


def _quotient(amount: Array, time_s: Array) -> Array:
    """Amount per time; NaN where the time is not stated or none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(time_s > 0, amount / time_s, np.nan)
