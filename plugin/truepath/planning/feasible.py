"""Poses that can be measured: within the joint limits, above the floor, in sight, free of collision, within reach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array
from truepath.model import nominal_flange_poses
from truepath.planning.free_space import FreeSpace
from truepath.planning.roadmap import NODES, Roadmap
from truepath.planning.sight import Sight
from truepath.robot import NominalRobot

LIMIT_MARGIN_RAD = np.radians(3.0)
LEAST_HEIGHT_M = 0.05  # of the reflector above the floor: lower, no tracker sees it
AT_ONCE, MOST_DRAWN = 5000, 2_000_000
ENOUGH_DRAWN = 200_000  # if none of them faces the tracker, none will
ENOUGH_ASKED, HARDLY_ANY = 2000, 0.003  # of so many that Drake looked at so few passed: no use to go on

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Feasible:
    """The test that every planned pose, and every random one that it is compared with, has to pass.

    Attributes:
        robot: nominal robot; its place in the world is that of the cell.
        X_FE: ``(4, 4)`` reflector on the flange.
        lower_rad, upper_rad: ``(n,)`` joints allowed.
        space: the cell; None where none is known.
        sight: the tracker; None where it sees everything.
        floor_m: height of the floor in the world.
        roadmap: from where poses must be within reach; None where that does not matter.
    """

    robot: NominalRobot
    X_FE: Array
    lower_rad: Array
    upper_rad: Array
    space: FreeSpace | None = None
    sight: Sight | None = None
    floor_m: float = 0.0
    roadmap: Roadmap | None = None

    @classmethod
    def within_limits(
        cls,
        robot: NominalRobot,
        X_FE: Array,
        space: FreeSpace | None,
        sight: Sight | None = None,
        span_rad: tuple[Array, Array] | None = None,
    ) -> Feasible:
        """Joints away from the robot's limits, half a turn at most: cables are seldom longer.

        With ``span_rad``, two arrays ``(n,)``, within these angles as well.
        """
        lower, upper = (-np.pi, np.pi) if span_rad is None else span_rad
        lower = np.maximum(lower, np.maximum(robot.lower_rad, -np.pi) + LIMIT_MARGIN_RAD)
        upper = np.minimum(upper, np.minimum(robot.upper_rad, np.pi) - LIMIT_MARGIN_RAD)
        floor = 0.0 if space is not None else float(robot.X_WB[2, 3])
        return cls(robot, X_FE, lower, np.maximum(upper, lower), space, sight, floor)

    def from_home(self, rng: np.random.Generator) -> Feasible:
        """The same, and within reach of the posture in which the cell's robot stands by default.

        Where that is not free, of the free one that is nearest to it.

        Raises:
            InputError: nothing is free.
        """
        if self.space is None:
            return self
        home = self.space.cell.default_joints
        everywhere = Feasible.within_limits(self.robot, self.X_FE, self.space)
        free = everywhere.draw(NODES, rng)
        if not len(free):
            raise everywhere.complain(rng)
        if not self.space.are_free(home[None])[0]:
            home = free[np.abs(free - home).max(axis=1).argmin()]
        return replace(self, roadmap=Roadmap(self.space, home, free))

    @property
    def home(self) -> Array | None:
        """``(n,)`` where the robot starts and ends; None where nobody knows the cell."""
        return None if self.roadmap is None else self.roadmap.nodes[0]

    def anywhere(self) -> Feasible:
        """The same without a tracker: where the robot can work."""
        return replace(self, sight=None)

    def check(self, q_rad: Array) -> Array:
        """``(N,)`` which of joints ``(N, n)`` can be measured."""
        passed = self.are_in_place(q_rad)
        passed[passed] = self.are_possible(q_rad[passed])
        return passed

    def are_possible(self, q_rad: Array) -> Array:
        """``(N,)`` the rest of the test, for poses that are in place."""
        passed = self._are_free(q_rad)
        passed[passed] = self.are_open(q_rad[passed])
        return passed

    def draw(
        self, count: int, rng: np.random.Generator, say: Progress = lambda _: None, *, roughly: bool = False
    ) -> Array:
        """``(k, n)`` random joints that pass, uniform over the joints allowed; fewer than ``count`` where few pass.

        With ``roughly`` of all but ``are_open``, which costs more than all else: for who looks at that for what he
        takes.
        """

        def hopeless() -> bool:
            return (drawn >= ENOUGH_DRAWN and not asked) or (asked >= ENOUGH_ASKED and number <= HARDLY_ANY * asked)

        found: list[Array] = []
        number = drawn = asked = 0
        while number < count and drawn < MOST_DRAWN and not hopeless():
            q = rng.uniform(self.lower_rad, self.upper_rad, (min(AT_ONCE, 4 * count), len(self.lower_rad)))
            drawn += len(q)
            q = q[self.are_in_place(q)]
            while len(q) and number < count and not hopeless():  # not all: Drake takes its time
                some, q = np.split(q, [min(200, len(q))])
                asked += len(some)
                some = some[self._are_free(some)]
                some = some if roughly else some[self.are_open(some)]
                found.append(some)
                number += len(some)
                say(f"{min(number, count)} of {count} candidates in {drawn} random poses")
        return np.concatenate(found or [np.zeros((0, len(self.lower_rad)))])[:count]

    def complain(self, rng: np.random.Generator) -> InputError:
        """Why hardly any pose passes, in plain words."""
        q = rng.uniform(self.lower_rad, self.upper_rad, (AT_ONCE, len(self.lower_rad)))
        X_WE = self._reflector(q)
        high = X_WE[:, 2, 3] - self.floor_m > LEAST_HEIGHT_M
        seen = high if self.sight is None else high & self.sight.sees(X_WE)
        if not high.any():
            return InputError("the reflector is below the floor wherever the arm goes", expected="a robot above it")
        if not seen.any() and self.sight is not None:
            distance = np.linalg.norm(self.sight.p_WT - X_WE[high, :3, 3], axis=1)
            near, far = self.sight.range_m
            if not ((distance >= near) & (distance <= far)).any():
                return InputError(
                    "the robot never comes within the tracker's range",
                    expected=f"--tracker and --range-m such that {near:g} to {far:g} m reach the arm",
                    found=f"distances from {distance.min():.2f} to {distance.max():.2f} m",
                )
            return InputError(
                "no pose turns the reflector towards the tracker",
                expected="a wider --acceptance-deg, another --reflector-axis, or another place of the tracker",
                found=f"a cone of {np.degrees(self.sight.acceptance_rad):g} degrees about the reflector's axis",
            )
        some = q[seen][:400]
        touching = np.zeros(len(some), bool) if self.space is None else ~self.space.are_free(some)
        if touching.mean() > 0.99:
            return InputError(
                "nothing is free in this cell: the arm touches it, or itself, nearly everywhere",
                expected="room for the arm to move",
                found=f"{touching.sum()} of {len(some)} poses in collision, or nearer than the margin",
            )
        return InputError(
            "hardly any pose can be measured",
            expected="a tracker that looks at the robot from where neither cell nor arm is in its way",
            found=f"{seen.mean():.2%} of random poses face the tracker within its range; of these "
            f"{touching.mean():.0%} are in collision, and nearly all others have something in the beam",
        )

    def _reflector(self, q_rad: Array) -> Array:
        return self.robot.X_WB @ nominal_flange_poses(self.robot, q_rad) @ self.X_FE

    def are_in_place(self, q_rad: Array) -> Array:
        """``(N,)`` the part of the test that asks nothing of Drake: limits, floor, range and cone of the tracker."""
        X_WE = self._reflector(q_rad)
        passed = ((q_rad >= self.lower_rad) & (q_rad <= self.upper_rad)).all(axis=1)
        passed &= X_WE[:, 2, 3] - self.floor_m > LEAST_HEIGHT_M
        return passed if self.sight is None else passed & self.sight.sees(X_WE)

    def are_open(self, q_rad: Array) -> Array:
        """``(N,)`` for poses that pass all else: whether a way leads there, and nothing is in the tracker's beam."""
        passed = np.ones(len(q_rad), bool)
        if self.space is None:
            return passed
        if self.roadmap is not None:
            passed = self.roadmap.reaches(q_rad)
        if self.sight is not None:
            p_WE = self._reflector(q_rad)[:, :3, 3]
            for k in np.flatnonzero(passed):
                passed[k] = self.space.beam_is_unbroken(q_rad[k], p_WE[k], self.sight.p_WT)
        return passed

    def _are_free(self, q_rad: Array) -> Array:
        return np.ones(len(q_rad), bool) if self.space is None else self.space.are_free(q_rad)
