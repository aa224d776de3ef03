"""What the preview shows: where the tool should be, where it would go, and how the arms move along it.

All points are those of the calibrated tool point (the probe, X_FE) in the robot base frame B.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truepath import lie
from truepath.lie import Array
from truepath.model import CalibratedModel, nominal_flange_poses, nominal_model
from truepath.robot import NominalRobot

CHUNK = 20_000
FINE_STEP_RAD = np.radians(3.0)  # lines are drawn through joint steps no longer than this
MOST_PARTS = 60
LINE_LIMIT = 2_000  # points per line; more cannot be told apart on a screen
FRAMES_PER_SECOND = 30
MAX_KEY_FRAMES = 400
SHORTEST_S, LONGEST_S = 6.0, 40.0
JOINT_SPEED_RAD_S = 0.6
DRAWN_ERROR_SHARE = 0.09  # of what is seen, for the automatic magnification
NICE_FACTORS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)


@dataclass(frozen=True, eq=False)
class Toolpaths:
    """Tool points ``(K, 3)`` in B, m.

    Attributes:
        goal: where the program wants the tool.
        uncorrected: where the real robot takes it if sent to the programmed joints.
        corrected: where the real robot takes it if sent to the corrected joints.
    """

    goal: Array
    uncorrected: Array
    corrected: Array

    @classmethod
    def of(cls, model: CalibratedModel, q_programmed: Array, q_corrected: Array) -> Toolpaths:
        """Tool points for joints ``(K, n)``."""
        points = np.empty((3, len(q_programmed), 3))
        for k in range(0, len(q_programmed), CHUNK):
            part = slice(k, k + CHUNK)
            X_BF_goal = model.goal_flange_poses(nominal_flange_poses(model.robot, q_programmed[part]))
            X_BF = (X_BF_goal, model.flange_poses(q_programmed[part]), model.flange_poses(q_corrected[part]))
            points[:, part] = [(X @ model.X_FE)[:, :3, 3] for X in X_BF]
        return cls(*points)

    def errors_mm(self) -> tuple[Array, Array]:
        """``(K,)`` distances from the goal without and with correction, mm."""
        return (
            1e3 * np.linalg.norm(self.uncorrected - self.goal, axis=1),
            1e3 * np.linalg.norm(self.corrected - self.goal, axis=1),
        )

    def magnified(self, factor: float) -> Toolpaths:
        """The same with errors drawn larger: goal + factor × (actual − goal)."""
        uncorrected, corrected = (self.goal + factor * (p - self.goal) for p in (self.uncorrected, self.corrected))
        return Toolpaths(self.goal, uncorrected, corrected)


@dataclass(frozen=True, eq=False)
class KeyFrames:
    """The animation: K moments and where the arms are then.

    Attributes:
        time_s: ``(K,)`` from 0.
        waypoint: ``(K,)`` place in the program, counted from 0; between waypoints a fraction.
        q_uncorrected, q_corrected: ``(K, n)`` joints with which the nominal arm, as it is drawn, has its tool
            point on the magnified line of the real robot.
        error_uncorrected_mm, error_corrected_mm: ``(K,)`` true size of the errors there.
    """

    time_s: Array
    waypoint: Array
    q_uncorrected: Array
    q_corrected: Array
    error_uncorrected_mm: Array
    error_corrected_mm: Array


def fine_positions(q_rad: Array) -> Array:
    """``(K,)`` fractional waypoint numbers, close enough for a line between waypoints ``(N, n)`` to show the arc.

    Between waypoints the joints are taken to move linearly.
    """
    steps = np.abs(np.diff(q_rad, axis=0)).max(axis=1, initial=0.0)
    parts = np.clip(np.ceil(steps / FINE_STEP_RAD), 1, MOST_PARTS).astype(int)
    start = np.repeat(np.arange(len(parts)), parts)
    within = np.arange(len(start)) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.append(start + within / np.repeat(parts, parts), len(q_rad) - 1.0)


def interpolate(q_rad: Array, position: Array) -> Array:
    """``(K, n)`` joints at fractional waypoint numbers ``(K,)`` of a path ``(N, n)``."""
    before = np.floor(position).astype(int)
    after = np.minimum(before + 1, len(q_rad) - 1)
    share = (position - before)[:, None]
    return q_rad[before] * (1.0 - share) + q_rad[after] * share


def thin_out(points: Array, limit: int = LINE_LIMIT) -> NDArray[np.int64]:
    """Indices of at most ``limit`` of the points ``(K, 3)`` whose line looks like the line through all.

    Of each block of neighbours the first is kept, and the one that lies furthest from the chord: corners stay.
    """
    K = len(points)
    if limit >= K:
        return np.arange(K)
    blocks = limit // 2 - 1
    edges = np.linspace(0, K - 1, blocks + 1).astype(int)
    block = np.minimum(np.searchsorted(edges, np.arange(K), side="right") - 1, blocks - 1)
    a, b = points[edges[block]], points[edges[block + 1]]
    chord = b - a
    share = np.einsum("ki,ki->k", points - a, chord) / np.maximum(np.einsum("ki,ki->k", chord, chord), 1e-30)
    distance = np.linalg.norm(points - a - np.clip(share, 0.0, 1.0)[:, None] * chord, axis=1)
    by_block = np.lexsort((distance, block))
    furthest = by_block[np.append(np.flatnonzero(np.diff(block[by_block])), K - 1)]
    return np.unique(np.concatenate([edges, furthest]))


def nice_magnification(paths: Toolpaths) -> float:
    """The round factor that makes the usual error well visible beside the arm and the path."""
    reach = float(np.linalg.norm(paths.goal, axis=1).max())
    size = max(reach, float(np.linalg.norm(np.ptp(paths.goal, axis=0))))
    error = float(np.quantile(np.linalg.norm(paths.uncorrected - paths.goal, axis=1), 0.95))
    wanted = DRAWN_ERROR_SHARE * size / max(error, 1e-9)
    return max((factor for factor in NICE_FACTORS if factor <= wanted), default=1.0)


def animate(model: CalibratedModel, q_programmed: Array, q_corrected: Array, magnification: float) -> KeyFrames:
    """Key frames of a run through the path at even joint speed, in 6 to 40 seconds.

    Args:
        q_programmed, q_corrected: ``(N, n)``.
        magnification: as the lines are drawn.
    """
    travel = np.append(0.0, np.cumsum(np.abs(np.diff(q_programmed, axis=0)).max(axis=1, initial=0.0)))
    if travel[-1] > 0:
        duration = float(np.clip(travel[-1] / JOINT_SPEED_RAD_S, SHORTEST_S, LONGEST_S))
        time_s = np.linspace(0.0, duration, min(MAX_KEY_FRAMES, int(duration * FRAMES_PER_SECOND) + 1))
        waypoint = np.interp(time_s / duration * travel[-1], travel, np.arange(len(travel)))
    else:
        time_s = waypoint = np.zeros(1)
    programmed, corrected = interpolate(q_programmed, waypoint), interpolate(q_corrected, waypoint)
    paths = Toolpaths.of(model, programmed, corrected)
    drawn = paths.magnified(magnification)
    return KeyFrames(
        time_s,
        waypoint,
        joints_reaching(model.robot, drawn.uncorrected, model.X_FE[:3, 3], programmed),
        joints_reaching(model.robot, drawn.corrected, model.X_FE[:3, 3], programmed),
        *paths.errors_mm(),
    )


def joints_reaching(robot: NominalRobot, p_BP: Array, p_FP: Array, q_start: Array) -> Array:
    """Joints ``(K, n)`` near ``q_start`` that bring a point of the nominal flange to ``p_BP`` ``(K, 3)``.

    For drawing only: the shortest damped joint steps, which come as near as they can if a point is out of reach.

    Args:
        p_FP: ``(3,)`` the point in the flange frame, m.
    """
    forward, q = nominal_model(robot).flange_poses_and_jacobian, q_start.copy()
    for _ in range(8):
        X_BF, J = forward(q)
        offset = X_BF[:, :3, :3] @ p_FP
        J_point = J[:, 3:] - lie.skew(offset) @ J[:, :3]
        missing = p_BP - X_BF[:, :3, 3] - offset
        J_t = np.swapaxes(J_point, 1, 2)
        step = (J_t @ np.linalg.solve(J_point @ J_t + 1e-4 * np.eye(3), missing[..., None]))[..., 0]
        q += step * np.minimum(1.0, 0.3 / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-12))
    return q
