"""What the preview shows: where the tool should be, where it would go, and where it will go corrected.

All points are those of one tool point in the robot base frame B: that of the program, or the calibrated one (X_FE).
"""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Literal

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array
from truepath.model import CalibratedModel, nominal_flange_poses
from truepath.preview.shown import ShownPath

CHUNK = 20_000
FINE_STEP_RAD = np.radians(3.0)  # lines are drawn through joint steps no longer than this
MOST_PARTS = 60
MOST_FINE_ROWS = 60_000  # beyond that no rows are added between those of the path
DRAWN_ERROR_SHARE = 0.09  # of what is seen, for the automatic magnification
NICE_FACTORS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
LARGEST_FACTOR = 1e4

Magnification = float | Literal["auto"]


@dataclass(frozen=True, eq=False)
class Toolpaths:
    """Tool points ``(K, 3)`` in B, m.

    Attributes:
        goal: where the program wants the tool.
        uncorrected: where the real robot takes it today.
        corrected: where the real robot takes it if sent to the corrected joints.
        X_BT_goal: ``(K, 4, 4)`` the poses of the tool that the program wants.
    """

    goal: Array
    uncorrected: Array
    corrected: Array
    X_BT_goal: Array

    @classmethod
    def of(
        cls, model: CalibratedModel, q_meant: Array, q_today: Array, q_corrected: Array, X_FT: Array | None = None
    ) -> Toolpaths:
        """Tool points for joints ``(K, n)``: meant, sent today, sent with the correction; see ``ShownPath``."""
        X_FT = model.X_FE if X_FT is None else X_FT
        poses = np.empty((3, len(q_meant), 4, 4))
        for k in range(0, len(q_meant), CHUNK):
            part = slice(k, k + CHUNK)
            poses[0, part] = model.goal_flange_poses(nominal_flange_poses(model.robot, q_meant[part]))
            poses[1, part] = model.flange_poses(q_today[part])
            poses[2, part] = model.flange_poses(q_corrected[part])
        poses = poses @ X_FT
        goal, uncorrected, corrected = poses[..., :3, 3]
        return cls(goal, uncorrected, corrected, poses[0])

    def errors_mm(self) -> tuple[Array, Array]:
        """``(K,)`` distances from the goal without and with correction, mm."""
        return (
            1e3 * np.linalg.norm(self.uncorrected - self.goal, axis=1),
            1e3 * np.linalg.norm(self.corrected - self.goal, axis=1),
        )

    def magnified(self, factor: float) -> Toolpaths:
        """The same with errors drawn larger: goal + factor × (actual − goal)."""
        uncorrected, corrected = (self.goal + factor * (p - self.goal) for p in (self.uncorrected, self.corrected))
        return Toolpaths(self.goal, uncorrected, corrected, self.X_BT_goal)

    def at(self, rows: Array) -> Toolpaths:
        """Some of the points."""
        return Toolpaths(self.goal[rows], self.uncorrected[rows], self.corrected[rows], self.X_BT_goal[rows])


def fine_positions(q_rad: Array, joined: Array | None = None) -> Array:
    """``(K,)`` fractional row numbers, close enough for a line between rows ``(N, n)`` to show the arc.

    Between rows the joints are taken to move linearly.

    Args:
        joined: ``(N,)`` False where a row is not reached from the one before: no line leads there. None: all are.
    """
    steps = np.abs(np.diff(q_rad, axis=0)).max(axis=1, initial=0.0)
    parts = np.clip(np.ceil(steps / FINE_STEP_RAD), 1, MOST_PARTS).astype(int)
    if joined is not None:
        parts = np.where(joined[1:], parts, 1)
    if parts.sum() > MOST_FINE_ROWS:
        parts = np.maximum(parts * min(1.0, MOST_FINE_ROWS / parts.sum()), 1).astype(int)
    start = np.repeat(np.arange(len(parts)), parts)
    within = np.arange(len(start)) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.append(start + within / np.repeat(parts, parts), len(q_rad) - 1.0)


def interpolate(rows: Array, position: Array) -> Array:
    """``(K, n)`` values at fractional row numbers ``(K,)`` of rows ``(N, n)``."""
    before = np.floor(position).astype(int)
    after = np.minimum(before + 1, len(rows) - 1)
    share = (position - before)[:, None]
    return rows[before] * (1.0 - share) + rows[after] * share


@dataclass(frozen=True, eq=False)
class FinePaths:
    """The paths through K points close enough to each other to be drawn.

    Attributes:
        position: ``(K,)`` fractional rows of the shown path.
        q_meant, q_corrected: ``(K, n)`` joints there.
        paths: in true size.
        piece: ``(K,)`` number of the connected piece of the line.
        outside: ``(K,)`` True where the calibration data did not reach.
        waypoint: ``(T,)`` which of these points are the waypoints.
    """

    position: Array
    q_meant: Array
    q_corrected: Array
    paths: Toolpaths
    piece: Array
    outside: Array
    waypoint: Array

    @classmethod
    def of(cls, model: CalibratedModel, shown: ShownPath, outside: Array) -> FinePaths:
        """Of a shown path of N rows.

        Args:
            outside: ``(N,)`` True where the calibration data did not reach.
        """
        position = fine_positions(shown.q_meant, shown.joined)
        meant, today, corrected = (interpolate(q, position) for q in (shown.q_meant, shown.q_today, shown.q_corrected))
        row = np.ceil(position - 1e-9).astype(int)
        return cls(
            position,
            meant,
            corrected,
            Toolpaths.of(model, meant, today, corrected, shown.X_FT),
            np.cumsum(~shown.joined)[row],
            outside[np.round(position).astype(int)],
            np.searchsorted(position, shown.waypoint - 1e-9),
        )


def stated_magnification(text: str) -> Magnification:
    """From a word of the command line.

    Raises:
        InputError: neither a number nor "auto".
    """
    if text == "auto":
        return "auto"
    try:
        return float(text)
    except ValueError:
        raise _no_factor(text) from None


def magnification_of(paths: Toolpaths, wanted: Magnification) -> float:
    """The factor by which errors are drawn: as wanted, or a round one for these paths.

    Raises:
        InputError: no factor above 0 and up to 10,000, nor "auto".
    """
    if wanted == "auto":
        return nice_magnification(paths)
    if not isinstance(wanted, Real) or not 0 < wanted <= LARGEST_FACTOR:
        raise _no_factor(wanted)
    return float(wanted)


def _no_factor(wanted: object) -> InputError:
    expected = "a factor above 0, up to 10000, or auto"
    return InputError("errors cannot be drawn at this scale", expected=expected, found=str(wanted))


def nice_magnification(paths: Toolpaths) -> float:
    """The round factor that makes the usual error well visible beside the arm and the path."""
    reach = float(np.linalg.norm(paths.goal, axis=1).max())
    size = max(reach, float(np.linalg.norm(np.ptp(paths.goal, axis=0))))
    error = float(np.quantile(np.linalg.norm(paths.uncorrected - paths.goal, axis=1), 0.95))
    wanted = DRAWN_ERROR_SHARE * size / max(error, 1e-9)
    return max((factor for factor in NICE_FACTORS if factor <= wanted), default=1.0)
