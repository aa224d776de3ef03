"""Motions of the tool along lines and arcs; the joints follow by small steps, as a controller's do.

Frames: C the controller's base, 0 its tool flange, T tool.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from truepath.lie import Array
from truepath.virtual.controller.kinematics import NominalKinematics, rotation, rotation_vector
from truepath.virtual.controller.motions import Schedule

LARGEST_STEP_M, LARGEST_STEP_RAD = 0.02, 0.05  # between two solutions: short, so that the posture is kept
M_PER_RAD = 0.25  # how much of a turn counts as much as a metre of way, for the speed of a move that hardly travels
RATE_STEP_S = 1e-4
EXTRAPOLATED_S = 0.01  # so far the speed before tells where the next solution is


class UnreachableError(Exception):
    """The path leads where the arm cannot follow."""


class Way(Protocol):
    """One leg of a tool's path."""

    @property
    def length_m(self) -> float:
        """For the profile of speed; turning counts as well."""

    def offset(self, share: float) -> Array:
        """``(3,)`` shift in C since its beginning."""

    def turn(self, share: float) -> Array:
        """``(3, 3)`` rotation, in the tool's frame, since its beginning."""


@dataclass(frozen=True, eq=False)
class Line:
    """Straight, turning about one axis."""

    shift: Array
    turn_rad: Array

    @classmethod
    def between(cls, X_start: Array, X_goal: Array) -> Line:
        return cls(X_goal[:3, 3] - X_start[:3, 3], rotation_vector(X_start[:3, :3].T @ X_goal[:3, :3]))

    @property
    def length_m(self) -> float:
        return max(float(np.linalg.norm(self.shift)), M_PER_RAD * float(np.linalg.norm(self.turn_rad)))

    def offset(self, share: float) -> Array:
        return share * self.shift

    def turn(self, share: float) -> Array:
        return rotation(share * self.turn_rad)


@dataclass(frozen=True, eq=False)
class Arc:
    """A circle through three points.

    Attributes:
        from_centre: ``(3,)`` from the centre to the beginning, in C, m.
        axis: ``(3,)`` unit vector in C.
        angle_rad: of the whole arc, positive.
        turn_rad: ``(3,)`` rotation of the tool in its own frame on the way.
    """

    from_centre: Array
    axis: Array
    angle_rad: float
    turn_rad: Array

    @classmethod
    def through(cls, X_start: Array, p_via: Array, X_goal: Array, follow: bool) -> Line | Arc:
        """From a pose through a point to another pose; a line where the three points are on one.

        With ``follow`` the tool turns along with the arc, whatever the orientation of the last pose.
        """
        p, goal = X_start[:3, 3], X_goal[:3, 3]
        u, v = p_via - p, goal - p
        normal = np.cross(u, v)
        if np.linalg.norm(normal) <= 1e-6 * np.linalg.norm(u) * np.linalg.norm(v) or not v.any():
            return Line.between(X_start, X_goal)
        centre = p + np.cross(u @ u * v - v @ v * u, normal) / (2 * normal @ normal)
        axis = normal / np.linalg.norm(normal)
        from_centre = p - centre
        side = np.cross(axis, from_centre)
        angle = math.atan2(float((goal - centre) @ side), float((goal - centre) @ from_centre)) % (2 * np.pi)
        R = X_start[:3, :3]
        turn = R.T @ (angle * axis) if follow else rotation_vector(R.T @ X_goal[:3, :3])
        return cls(from_centre, axis, angle, turn)

    @property
    def length_m(self) -> float:
        return max(self.angle_rad * float(np.linalg.norm(self.from_centre)), M_PER_RAD * abs(self.turn_rad).max())

    def offset(self, share: float) -> Array:
        return rotation(share * self.angle_rad * self.axis) @ self.from_centre - self.from_centre

    def turn(self, share: float) -> Array:
        return rotation(share * self.turn_rad)


@dataclass(frozen=True, eq=False)
class Drift:
    """A velocity of the tool that is reached and then held (``speedl``); a share is a second.

    Attributes:
        velocity: ``(2, 3)`` at the beginning and after the ramp, m/s in C.
        turning: ``(2, 3)`` the same, rad/s in the tool's frame at the beginning.
        ramp_s: from one to the other.
    """

    velocity: Array
    turning: Array
    ramp_s: float
    length_m: float = math.inf

    def offset(self, share: float) -> Array:
        return self._integral(self.velocity, share)

    def turn(self, share: float) -> Array:
        return rotation(self._integral(self.turning, share))

    def _integral(self, rates: Array, time_s: float) -> Array:
        rising = min(time_s, self.ramp_s)
        change = rates[1] - rates[0]
        return rates[0] * rising + 0.5 * change * rising**2 / self.ramp_s + rates[1] * (time_s - rising)


@dataclass(frozen=True)
class Seconds:
    """The profile of what does not end: a share is a second."""

    duration_s: float = math.inf

    def at(self, time_s: float) -> tuple[float, float]:
        return max(time_s, 0.0), 1.0


class ToolPath:
    """The tool along a chain of ways.

    Args:
        kinematics: of the arm.
        q_start_rad: ``(6,)`` where it begins.
        X_0T: tool in force.
        ways: the legs, one after the other.
        schedule: of the legs.
    """

    def __init__(
        self, kinematics: NominalKinematics, q_start_rad: Array, X_0T: Array, ways: Sequence[Way], schedule: Schedule
    ) -> None:
        self._kinematics, self._ways, self.schedule = kinematics, ways, schedule
        self._X_T0 = np.linalg.inv(X_0T)
        X_CT = kinematics.forward(q_start_rad) @ X_0T
        self._corners = [X_CT]
        for way in ways[:-1]:
            self._corners.append(_moved(self._corners[-1], way.offset(1.0), way.turn(1.0)))
        self._X_0T = X_0T
        self._known_q, self._known_qd, self._known_time = np.array(q_start_rad), np.zeros(6), 0.0
        self._known_X = X_CT
        self.duration_s = schedule.duration_s

    def at(self, time_s: float) -> tuple[Array, Array]:
        """As of a motion.

        Raises:
            UnreachableError: the arm cannot follow to there.
        """
        t = min(max(time_s, 0.0), self.duration_s)
        q = self._follow(t)
        if t in (0.0, self.duration_s):
            return q, np.zeros(6)
        near = t - RATE_STEP_S if t > RATE_STEP_S else t + RATE_STEP_S
        X, before = self._known_X, self._tool(near)
        turned = rotation_vector(X[:3, :3] @ before[:3, :3].T)
        velocity = np.concatenate([turned, X[:3, 3] - before[:3, 3]]) / (t - near)
        self._known_qd = self._kinematics.joint_speeds(q, self._X_0T, velocity)
        return q, self._known_qd

    def _follow(self, time_s: float) -> Array:
        """From the last solution to this time, in steps over which nothing changes much."""
        goal = self._tool(time_s)
        far = max(
            float(np.linalg.norm(goal[:3, 3] - self._known_X[:3, 3])) / LARGEST_STEP_M,
            float(np.linalg.norm(goal[:3, :3] - self._known_X[:3, :3])) / LARGEST_STEP_RAD,
            abs(time_s - self._known_time),  # a path may come back to where it was
        )
        q, step_s = self._known_q, time_s - self._known_time
        count = max(math.ceil(far), 1)
        if abs(step_s) < EXTRAPOLATED_S:
            q = q + self._known_qd * step_s
        for k in range(1, count):
            q = self._solved(self._tool(self._known_time + step_s * k / count), q)
        q = self._solved(goal, q)
        self._known_q, self._known_time, self._known_X = q, time_s, goal
        return q

    def _solved(self, X_CT: Array, q_near: Array) -> Array:
        q = self._kinematics.followed(X_CT @ self._X_T0, q_near)
        if q is None or np.abs(q - q_near).max() > 1.0:
            raise UnreachableError(f"the arm cannot follow its path to {np.round(X_CT[:3, 3], 4).tolist()} m")
        return q

    def _tool(self, time_s: float) -> Array:
        """``(4, 4)`` X_CT at a time."""
        leg, before, now = self.schedule.at(time_s)
        way = self._ways[leg]
        if not leg or before[0] >= 1.0:
            return _moved(self._corners[leg], way.offset(now[0]), way.turn(now[0]))
        last = self._ways[leg - 1]
        X = _moved(self._corners[leg - 1], last.offset(before[0]), last.turn(before[0]))
        return _moved(X, way.offset(now[0]), way.turn(now[0]))


def _moved(X_CT: Array, shift: Array, turn: Array) -> Array:
    X = X_CT.copy()
    X[:3, 3] += shift
    X[:3, :3] = X_CT[:3, :3] @ turn
    return X
