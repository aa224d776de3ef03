"""How the arms move along the paths: key frames, between which the joints are interpolated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath import lie
from truepath.lie import Array
from truepath.model import CalibratedModel, nominal_model
from truepath.preview.thinning import thin_out
from truepath.preview.toolpaths import FinePaths
from truepath.robot import NominalRobot

MOST_KEY_FRAMES = 2_000
SHORTEST_S, LONGEST_S = 6.0, 40.0
JOINT_SPEED_RAD_S = 0.6
TOLERANCE_M = 2e-4  # by which the arms may be off the lines between key frames
METRES_PER_RAD = 0.3  # what a joint's angle counts when frames are chosen
METRES_AT_WORST = 0.05  # what the largest error counts


@dataclass(frozen=True, eq=False)
class KeyFrames:
    """The animation: K moments and where the arms are then.

    Attributes:
        time_s: ``(K,)`` from 0.
        position: ``(K,)`` fractional row of the shown path.
        q_uncorrected, q_corrected: ``(K, n)`` joints with which the nominal arm, as it is drawn, has its tool
            point on the magnified line of the real robot.
        error_uncorrected_mm: ``(K,)`` true size of the errors without correction there.
    """

    time_s: Array
    position: Array
    q_uncorrected: Array
    q_corrected: Array
    error_uncorrected_mm: Array


def animate(model: CalibratedModel, fine: FinePaths, p_FT: Array, magnification: float) -> KeyFrames:
    """A run through the path at even joint speed, in 6 to 40 seconds; first, last and worst point are frames.

    Args:
        p_FT: ``(3,)`` the tool point in the flange, m.
        magnification: as the lines are drawn.
    """
    travel = np.append(0.0, np.cumsum(np.abs(np.diff(fine.q_meant, axis=0)).max(axis=1, initial=0.0)))
    if not travel[-1] > 0:
        kept, time_s = np.zeros(1, int), np.zeros(len(travel))
    else:
        duration = float(np.clip(travel[-1] / JOINT_SPEED_RAD_S, SHORTEST_S, LONGEST_S))
        time_s = travel / travel[-1] * duration
        kept = _chosen(fine, magnification)
    drawn, error_mm = fine.paths.magnified(magnification).at(kept), fine.paths.at(kept).errors_mm()[0]
    meant = fine.q_meant[kept]
    return KeyFrames(
        time_s[kept],
        fine.position[kept],
        joints_reaching(model.robot, drawn.uncorrected, p_FT, meant),
        joints_reaching(model.robot, drawn.corrected, p_FT, meant),
        error_mm,
    )


def _chosen(fine: FinePaths, magnification: float) -> Array:
    """``(K,)`` points between which arms and errors may be interpolated."""
    drawn, errors = fine.paths.magnified(magnification), np.stack(fine.paths.errors_mm(), axis=1)
    worst = np.argmax(errors, axis=0)
    shares = errors / np.maximum(errors.max(), 1e-9)
    features = np.concatenate(
        [METRES_PER_RAD * fine.q_meant, drawn.uncorrected, drawn.corrected, METRES_AT_WORST * shares], axis=1
    )
    kept = thin_out(features, MOST_KEY_FRAMES, TOLERANCE_M, at=fine.position)
    return np.union1d(kept, worst)


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
