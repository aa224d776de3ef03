"""A pose as it is visited: once, or from both sides, so that play in the gears shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath.lie import Array
from truepath.planning.feasible import Feasible
from truepath.planning.information import ReadingModel

RUN_UP_RAD = np.radians(3.0)  # far more than any play; a pose is at least so far from the joint limits


@dataclass(frozen=True, eq=False)
class Visiting:
    """How poses are visited and what that tells.

    Attributes:
        model: of the readings.
        feasible: what a pose has to pass.
        both_sides: every joint of a pose arrives once in each direction, from run-up points on either side.
    """

    model: ReadingModel
    feasible: Feasible
    both_sides: bool = False

    @property
    def stops(self) -> int:
        """Measurements of one visited pose."""
        return 2 if self.both_sides else 1

    def directions(self, count: int, rng: np.random.Generator) -> Array:
        """``(count, n)`` in {-1, 1}: the direction of first arrival of every joint, drawn so that joints differ."""
        return rng.choice([-1.0, 1.0], (count, self.model.robot.num_joints))

    def blocks(self, q_rad: Array, directions: Array) -> Array:
        """``(N, r, K)`` derivatives of all readings of a pose, in units of their noise.

        Args:
            q_rad: ``(N, n)`` poses.
            directions: ``(N, n)`` of first arrival.
        """
        if not self.both_sides:
            return self.model.readings(q_rad)
        return np.concatenate([self.model.readings(q_rad, sign * directions) for sign in (1.0, -1.0)], axis=1)

    def run_ups(self, q_rad: Array, directions: Array) -> Array:
        """``(N, 2, n)`` points from which poses are approached, first and second."""
        return q_rad[:, None] + RUN_UP_RAD * np.stack([-directions, directions], axis=1)

    def are_possible(self, q_rad: Array, directions: Array) -> Array:
        """``(N,)`` which poses can be visited so, of those that are in place."""
        passed = self.feasible.are_possible(q_rad)
        return passed & self.can_be_approached(q_rad, directions, passed)

    def can_be_approached(self, q_rad: Array, directions: Array, asked: Array | None = None) -> Array:
        """``(N,)`` whether both run-up points are free, if any are needed; only those ``asked`` are looked at."""
        space = self.feasible.space
        if not self.both_sides or space is None:
            return np.ones(len(q_rad), bool)
        passed = np.ones(len(q_rad), bool) if asked is None else asked.copy()
        for side in (0, 1):
            passed[passed] = space.are_free(self.run_ups(q_rad[passed], directions[passed])[:, side])
        return passed
