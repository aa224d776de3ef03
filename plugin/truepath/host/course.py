"""What is shown in a host: the way through a program, a path of joints or a trajectory, and how its tool goes it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from truepath import lie
from truepath.host.placed_robot import PlacedRobot
from truepath.iso9283 import ErrorStatistics
from truepath.lie import Array
from truepath.preview.shown import Remark, ShownPath
from truepath.preview.thinning import LINE_LIMIT, thin_out
from truepath.preview.toolpaths import FinePaths, Toolpaths

JOINT_SPEED_RAD_S, TOOL_SPEED_M_S = 0.6, 0.1
SHORTEST_S, LONGEST_S = 6.0, 60.0
METRES_PER_RAD, ERROR_WEIGHT = 0.3, 50.0  # what joints and errors count when points are chosen


@dataclass(frozen=True, eq=False)
class Course:
    """K points along a shown path, close enough to each other to be drawn. Frames: W world, T tool.

    Attributes:
        shown: the path.
        fine: the points; positions in the base frame of the calibrated robot.
        X_WT: ``(K, 4, 4)`` where the program means the tool to be.
        p_FT: ``(3,)`` the tool point on the flange as drawn, m.
        meant, real, corrected: ``(K, 3)`` the tool point: meant, today, with the correction; in W, m.
        real_mm, corrected_mm: ``(K,)`` how far the latter two are off the first.
        time_s: ``(K,)`` when the points are passed, at moderate speed of joints and tool.
        kept: ``(L,)`` points that show all of it on a screen; between them joints and lines may be taken as straight.
        remarks: what is to be looked at, in the order in which it is passed.
    """

    shown: ShownPath
    fine: FinePaths
    X_WT: Array
    p_FT: Array
    meant: Array
    real: Array
    corrected: Array
    real_mm: Array
    corrected_mm: Array
    time_s: Array
    kept: Array
    remarks: tuple[Remark, ...]

    @classmethod
    def of(cls, robot: PlacedRobot, shown: ShownPath) -> Course:
        """With the program's own tool if it has one, else the host's.

        Errors at a program's tool are those that ``correct`` and the page tell, to the last digit: with the tool on
        the flange as the program states it, also where the calibration knows the flange to be a little off.
        """
        X_FT, X_FT_used = robot.X_FT, robot.X_FT_real
        if shown.X_FT is not None:
            X_FT = X_FT_used = shown.X_FT
        fine = FinePaths.of(robot.model, replace(shown, X_FT=X_FT_used), shown.outside(robot.region))
        paths: Toolpaths = fine.paths
        X_FF_real = robot.X_FT_real @ lie.invert(robot.X_FT)
        X_WT = robot.X_WB_real @ paths.X_BT_goal @ (lie.invert(X_FT_used) @ X_FF_real @ X_FT)
        meant, R_WB = X_WT[:, :3, 3], robot.X_WB_real[:3, :3]
        real, corrected = (meant + (points - paths.goal) @ R_WB.T for points in (paths.uncorrected, paths.corrected))
        remarks = sorted((*shown.remarks, *shown.stretches_outside(robot.region)), key=lambda each: each.waypoint or 0)
        return cls(
            shown,
            fine,
            X_WT,
            X_FT[:3, 3],
            meant,
            real,
            corrected,
            *paths.errors_mm(),
            _times(fine, meant),
            _kept(fine, meant, real, corrected),
            tuple(remarks),
        )

    @property
    def duration_s(self) -> float:
        """Of a run through all of it; 0 where nothing moves."""
        return float(self.time_s[-1])

    @property
    def worst(self) -> int:
        """The waypoint at which the tool is off most today, counted from 0."""
        return int(np.argmax(self.real_mm[self.fine.waypoint]))

    def at_waypoints(self) -> tuple[ErrorStatistics, ErrorStatistics]:
        """Errors at the waypoints: today, corrected; in true size."""
        real, corrected = (errors[self.fine.waypoint] for errors in (self.real_mm, self.corrected_mm))
        return ErrorStatistics.of(real), ErrorStatistics.of(corrected)

    def drawn(self, points: Array, magnification: float) -> Array:
        """``(K, 3)`` points of the real tool with their distance from those meant magnified."""
        return self.meant + magnification * (points - self.meant)

    def share_of(self, waypoint: int) -> float:
        """When a waypoint is passed, as a share of the whole time."""
        at = int(self.fine.waypoint[waypoint])
        return float(self.time_s[at] / self.duration_s) if self.duration_s else 0.0

    def at(self, share: float) -> tuple[int, int, float]:
        """Which of the kept points are before and after a moment, and how much of the time between them is over."""
        return _between(self.time_s[self.kept], share * self.duration_s)

    def errors_mm(self, share: float) -> tuple[float, float]:
        """How far the tool is off at a moment: today, corrected."""
        time = share * self.duration_s
        return float(np.interp(time, self.time_s, self.real_mm)), float(np.interp(time, self.time_s, self.corrected_mm))

    def towards(self, share: float) -> tuple[int, bool]:
        """The waypoint on whose way a moment is, counted from 0, and whether the data did not reach this point."""
        before, after, within = _between(self.time_s, share * self.duration_s)
        point = after if within > 0 else before
        waypoint = int(np.searchsorted(self.fine.waypoint, point))
        return min(waypoint, len(self.fine.waypoint) - 1), bool(self.fine.outside[point])


def moved_points(X_AB: Array, p_B: Array) -> Array:
    """``(K, 3)`` points given in B, counted in A."""
    return p_B @ X_AB[:3, :3].T + X_AB[:3, 3]


def _times(fine: FinePaths, points: Array) -> Array:
    """Neither joints nor tool faster than moderately, all of it in a time that somebody will look on."""
    turn = np.abs(np.diff(fine.q_meant, axis=0)).max(axis=1, initial=0.0) / JOINT_SPEED_RAD_S
    way = np.linalg.norm(np.diff(points, axis=0), axis=1) / TOOL_SPEED_M_S
    time_s = np.concatenate([[0.0], np.cumsum(np.maximum(turn, way))])
    total = float(time_s[-1])
    return time_s * (float(np.clip(total, SHORTEST_S, LONGEST_S)) / total) if total > 0 else time_s


def _between(times: Array, time: float) -> tuple[int, int, float]:
    """The moments ``(L,)`` before and after one, and its share of the time between them."""
    after = int(np.clip(np.searchsorted(times, time), min(1, len(times) - 1), len(times) - 1))
    before = max(after - 1, 0)
    step = times[after] - times[before]
    return before, after, float(np.clip((time - times[before]) / step, 0.0, 1.0)) if step > 0 else 0.0


def _kept(fine: FinePaths, meant: Array, real: Array, corrected: Array) -> Array:
    """``(L,)`` all points if they are few, else those at which joints, lines and errors bend most, and the worst."""
    if len(meant) <= LINE_LIMIT:
        return np.arange(len(meant))
    errors = [ERROR_WEIGHT * (points - meant) for points in (real, corrected)]
    bends = thin_out(np.concatenate([METRES_PER_RAD * fine.q_meant, meant, *errors], axis=1))
    cuts = np.flatnonzero(np.diff(fine.piece))
    worst = [np.argmax(np.linalg.norm(error, axis=1)) for error in errors]
    return np.unique(np.concatenate([bends, cuts, cuts + 1, worst]))
