"""Motions in joints: where the arm is at any time since they began. Nothing is stepped: whoever asks, is told."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from truepath.lie import Array
from truepath.virtual.controller.profiles import Trapezoid


class Motion(Protocol):
    """A motion of six joints."""

    @property
    def duration_s(self) -> float:
        """Infinite where somebody else has to end it."""

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Joints ``(6,)`` rad and their speeds ``(6,)`` rad/s, that long after the beginning; at rest at the end."""


@dataclass(frozen=True, eq=False)
class Rest:
    """No motion."""

    q_rad: Array
    duration_s: float = 0.0

    def at(self, time_s: float) -> tuple[Array, Array]:
        return self.q_rad, np.zeros(6)


class Profile(Protocol):
    """How far along its way a leg is."""

    @property
    def duration_s(self) -> float:
        """Of the leg."""

    def at(self, time_s: float) -> tuple[float, float]:
        """Share of the way, and its change per second."""


class Schedule:
    """Legs one after the other, each of which may begin before the one before it ends; never three at once.

    Args:
        profiles: of the legs.
        overlaps_s: between each leg and the next.
    """

    def __init__(self, profiles: Sequence[Profile], overlaps_s: Sequence[float]) -> None:
        self.profiles = list(profiles)
        self.starts_s: list[float] = []
        begin = 0.0
        for k, profile in enumerate(self.profiles):
            self.starts_s.append(begin)
            overlap = overlaps_s[k] if k < len(overlaps_s) else 0.0
            following = self.profiles[k + 1].duration_s if k + 1 < len(self.profiles) else 0.0
            begin += profile.duration_s - min(overlap, 0.5 * profile.duration_s, 0.5 * following)
        self.duration_s = begin

    def at(self, time_s: float) -> tuple[int, tuple[float, float], tuple[float, float]]:
        """Number of the latest leg; share and its change of the leg before it (1, 0 where none is), and of this leg."""
        leg = max(bisect_right(self.starts_s, time_s) - 1, 0)
        before = self.profiles[leg - 1].at(time_s - self.starts_s[leg - 1]) if leg else (1.0, 0.0)
        return leg, before, self.profiles[leg].at(time_s - self.starts_s[leg])


class JointPath:
    """Joint-linear legs through targets, corners rounded by letting neighbouring legs overlap.

    Args:
        waypoints_rad: ``(N + 1, 6)``, the start first.
        schedule: of the N legs.
    """

    def __init__(self, waypoints_rad: Array, schedule: Schedule) -> None:
        self.waypoints_rad, self.schedule = waypoints_rad, schedule
        self.duration_s = schedule.duration_s

    @classmethod
    def to(
        cls, q_start: Array, q_goal: Array, speed: float, acceleration: float, time_s: float | None = None
    ) -> JointPath:
        """One leg; speed and acceleration are those of the leading joint."""
        profile = Trapezoid.of(float(np.abs(q_goal - q_start).max()), speed, acceleration, time_s)
        return cls(np.stack([q_start, q_goal]), Schedule([profile], []))

    def at(self, time_s: float) -> tuple[Array, Array]:
        leg, before, now = self.schedule.at(time_s)
        step = self.waypoints_rad[leg + 1] - self.waypoints_rad[leg]
        q, qd = self.waypoints_rad[leg] + now[0] * step, now[1] * step
        if leg:
            last = self.waypoints_rad[leg] - self.waypoints_rad[leg - 1]
            q, qd = q - (1.0 - before[0]) * last, qd + before[1] * last
        return q, qd


@dataclass(frozen=True, eq=False)
class AtSpeed:
    """Joint speeds, reached at an acceleration of the joint that changes most, then held."""

    q_start: Array
    qd_start: Array
    qd_goal: Array
    acceleration: float
    duration_s: float = math.inf

    def at(self, time_s: float) -> tuple[Array, Array]:
        change = self.qd_goal - self.qd_start
        ramp = float(np.abs(change).max()) / self.acceleration
        t = min(max(time_s, 0.0), self.duration_s)
        rising = min(t, ramp)
        q = self.q_start + self.qd_start * rising + (0.5 * change * rising**2 / ramp if ramp else 0.0)
        return q + self.qd_goal * (t - rising), self.qd_start + change * (rising / ramp if ramp else 1.0)


@dataclass(frozen=True, eq=False)
class Pursuit:
    """Towards a target that is replaced again and again (``servoj``): critically damped, lagging by a given time."""

    q_start: Array
    qd_start: Array
    q_goal: Array
    lag_s: float
    duration_s: float = math.inf

    def at(self, time_s: float) -> tuple[Array, Array]:
        rate, t = 2.0 / self.lag_s, max(time_s, 0.0)
        away = self.q_start - self.q_goal
        slope = self.qd_start + rate * away
        fading = math.exp(-rate * t)
        return self.q_goal + (away + slope * t) * fading, (slope - rate * (away + slope * t)) * fading


class SlowingDown:
    """A motion that is to stop: it goes on along its own way, its clock running ever slower.

    Args:
        motion: what goes on.
        elapsed_s: how long it has gone on.
        duration_s: until it stands.
    """

    def __init__(self, motion: Motion, elapsed_s: float, duration_s: float) -> None:
        self._motion, self._elapsed_s, self.duration_s = motion, elapsed_s, duration_s

    def at(self, time_s: float) -> tuple[Array, Array]:
        t = min(max(time_s, 0.0), self.duration_s)
        if self.duration_s == 0.0:
            return self._motion.at(self._elapsed_s)[0], np.zeros(6)
        q, qd = self._motion.at(self._elapsed_s + t - 0.5 * t**2 / self.duration_s)
        return q, qd * (1.0 - t / self.duration_s)
