"""The parameters that a perfect calibration of a virtual robot would find, from Drake's frames alone.

Base and axis deviations can imitate each other; a calibration fixes the difference by holding axis 1, and
two deviations of axis 2, at nominal. The truth is expressed in the same way: the base is put where these
six vanish. No formula of ``poe`` is used here.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from truepath.lie import Array
from truepath.virtual.real_robot import RealRobot

HELD = (0, 1, 2, 3, 5, 7)  # of the axis deviations: axis 1 whole, pos_y and rot_y of axis 2


def true_deviations(real: RealRobot) -> tuple[Array, Array, Array]:
    """What was hidden, in the terms of a calibration.

    Returns:
        Axis deviations ``(n, 4)`` (pos_x, pos_y in m, rot_x, rot_y in rad); X_WB ``(4, 4)``; the reflector's
        pose X_FE ``(4, 4)`` on the flange.
    """
    directions, points = real.axis_lines()
    robot = real.robot

    def in_base(step: Array) -> tuple[Array, Array]:
        R = Rotation.from_matrix(robot.X_WB[:3, :3]) * Rotation.from_rotvec(step[3:])
        return R.inv().apply(directions), R.inv().apply(points - robot.X_WB[:3, 3] - step[:3])

    def held(step: Array) -> Array:
        return _deviations(robot.X_BA, *in_base(step)).ravel()[list(HELD)]

    step = fsolve(held, np.zeros(6), xtol=1e-12)
    X_WB = np.eye(4)
    X_WB[:3, :3] = robot.X_WB[:3, :3] @ Rotation.from_rotvec(step[3:]).as_matrix()
    X_WB[:3, 3] = robot.X_WB[:3, 3] + step[:3]
    at_zero = real.reflector_poses(np.zeros((1, robot.num_joints)))[0]
    X_FE = np.linalg.inv(X_WB @ robot.X_BF) @ at_zero
    return _deviations(robot.X_BA, *in_base(step)), X_WB, X_FE


def _deviations(X_BA: Array, directions: Array, points: Array) -> Array:
    """A line in its nominal axis frame: where it meets the plane z = 0, and its tilt as Rx(rot_x) Ry(rot_y)."""
    d = np.einsum("ijk,ij->ik", X_BA[:, :3, :3], directions)
    p = np.einsum("ijk,ij->ik", X_BA[:, :3, :3], points - X_BA[:, :3, 3])
    foot = p - d * (p[:, 2] / d[:, 2])[:, None]
    return np.stack([foot[:, 0], foot[:, 1], np.arctan2(-d[:, 1], d[:, 2]), np.arcsin(d[:, 0])], axis=1)
