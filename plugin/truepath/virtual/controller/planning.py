"""From commands to motions: single moves, and paths whose corners are rounded.

A corner is rounded by letting the next leg begin while the one before slows down. With r the radius of a blend, the
overlap begins no sooner than r before the corner, so the path stays within r of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array
from truepath.virtual.controller.cartesian import Arc, Drift, Line, Seconds, ToolPath, Way
from truepath.virtual.controller.kinematics import NominalKinematics, pose_matrix
from truepath.virtual.controller.motions import JointPath, Motion, Schedule
from truepath.virtual.controller.profiles import Trapezoid

MOST_COORDINATE = 1e3
LEAST_RAMP_S = 0.002


@dataclass(frozen=True, eq=False)
class Leg:
    """A move of a path.

    Attributes:
        target: joints ``(6,)`` of a joint move; X_CT ``(4, 4)`` of a line or an arc.
        via: ``(3,)`` point of an arc in C, m; None for a line.
        follow: an arc along which the tool turns.
        speed, acceleration, time_s, blend_m: as in the script.
    """

    target: Array
    speed: float
    acceleration: float
    time_s: float | None = None
    blend_m: float = 0.0
    via: Array | None = None
    follow: bool = False

    @property
    def joint(self) -> bool:
        """Along joints."""
        return self.target.shape == (6,)


def joints_of(numbers: Sequence[float], kinematics: NominalKinematics) -> Array:
    """``(6,)`` joints that a client sends.

    Raises:
        InputError: not six finite angles within the limits.
    """
    q = np.array(numbers, float)
    if q.shape != (6,) or not np.isfinite(q).all():
        raise InputError("joints that are none", expected="six finite angles", found=str(list(numbers)))
    if (q < kinematics.lower_rad).any() or (q > kinematics.upper_rad).any():
        raise InputError("joints beyond their limits", found=str(q.round(4).tolist()))
    return q


def pose_of(numbers: Sequence[float]) -> Array:
    """``(4, 4)`` of a pose that a client sends.

    Raises:
        InputError: not six finite numbers of a sensible size.
    """
    pose = np.array(numbers, float)
    if pose.shape != (6,) or not np.isfinite(pose).all() or np.abs(pose).max() > MOST_COORDINATE:
        raise InputError("a pose that is none", expected="six finite numbers", found=str(list(numbers)))
    return pose_matrix(pose)


def path(kinematics: NominalKinematics, q_start: Array, X_0T: Array, legs: Sequence[Leg]) -> JointPath | ToolPath:
    """The motion along legs of one kind, all joint moves or none.

    Raises:
        InputError: speeds that move nothing.
    """
    if legs[0].joint:
        return _joint_path(kinematics, q_start, X_0T, legs)
    ways: list[Way] = []
    X = kinematics.forward(q_start) @ X_0T
    for leg in legs:
        via = leg.via
        ways.append(Line.between(X, leg.target) if via is None else Arc.through(X, via, leg.target, leg.follow))
        end = X.copy()
        end[:3, 3] += ways[-1].offset(1.0)
        end[:3, :3] = X[:3, :3] @ ways[-1].turn(1.0)
        X = end
    profiles = [
        Trapezoid.of(way.length_m, leg.speed, leg.acceleration, leg.time_s) for way, leg in zip(ways, legs, strict=True)
    ]
    lengths = [way.length_m for way in ways]
    return ToolPath(kinematics, q_start, X_0T, ways, Schedule(profiles, _overlaps(profiles, lengths, lengths, legs)))


def at_tool_speed(
    kinematics: NominalKinematics, q: Array, qd: Array, X_0T: Array, velocity: Sequence[float], acceleration: float
) -> Motion:
    """``speedl``: a velocity of the tool in C, ``(6,)`` m/s and rad/s, until somebody ends it.

    Raises:
        InputError: numbers that are none.
    """
    goal = np.array(velocity, float)
    if not np.isfinite(goal).all() or np.abs(goal).max() > MOST_COORDINATE or not acceleration > 0:
        raise InputError("a speed of the tool that is none", found=str(list(velocity)))
    R_CT = (kinematics.forward(q) @ X_0T)[:3, :3]
    now = kinematics.jacobian(q, X_0T) @ qd
    ramp = max(float(np.linalg.norm(goal[:3] - now[3:])) / acceleration, LEAST_RAMP_S)
    way = Drift(np.stack([now[3:], goal[:3]]), np.stack([now[:3], goal[3:]]) @ R_CT, ramp)
    return ToolPath(kinematics, q, X_0T, [way], Schedule([Seconds()], []))


def _joint_path(kinematics: NominalKinematics, q_start: Array, X_0T: Array, legs: Sequence[Leg]) -> JointPath:
    waypoints = np.stack([q_start, *(leg.target for leg in legs)])
    steps = np.diff(waypoints, axis=0)
    leading = np.abs(steps).max(axis=1)
    profiles = [
        Trapezoid.of(float(length), leg.speed, leg.acceleration, leg.time_s)
        for length, leg in zip(leading, legs, strict=True)
    ]
    # How far the tool travels along each leg, seen from its end and from its beginning.
    before, after = [0.0] * len(legs), [0.0] * len(legs)
    for k, leg in enumerate(legs):
        if leg.blend_m > 0 and k + 1 < len(legs):
            J = kinematics.jacobian(waypoints[k + 1], X_0T)[3:]
            before[k] = float(np.linalg.norm(J @ steps[k]))
            after[k + 1] = float(np.linalg.norm(J @ steps[k + 1]))
    return JointPath(waypoints, Schedule(profiles, _overlaps(profiles, before, after, legs)))


def _overlaps(
    profiles: Sequence[Trapezoid], before: Sequence[float], after: Sequence[float], legs: Sequence[Leg]
) -> list[float]:
    """How long each leg overlaps with the next, s; half of the radius belongs to each of them."""
    overlaps = []
    for k in range(len(legs) - 1):
        radius = 0.5 * max(legs[k].blend_m, 0.0)
        if radius == 0.0:
            overlaps.append(0.0)
            continue
        shares = (radius / max(before[k], 1e-12), radius / max(after[k + 1], 1e-12))
        overlaps.append(min(profiles[k].overlap(shares[0]), profiles[k + 1].overlap(shares[1])))
    return overlaps
