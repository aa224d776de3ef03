r"""Product of exponentials with deviations: the parameters, and batched forward kinematics in numpy.

The same model as a CasADi expression, for derivatives, is in ``poe_symbolic``.

.. math:: T(\theta) = B \, e^{\hat\xi_1 \varphi_1} \cdots e^{\hat\xi_n \varphi_n} \, M \, E

(Jiang et al. 2020, eq. 1 to 7; deviations of the screws after He et al. 2010.) Axis i moves in its four
observable directions: its frame becomes ``X_BA_i * X(d_i)``, where ``X(d)`` first shifts by
(pos_x, pos_y, 0) and then turns by Rx(rot_x) Ry(rot_y). A rotation about the axis or a shift along it
changes nothing and is no parameter, so the model is minimal per axis and continuous for parallel axes.
B and E are moved from a reference pose by the same kind of small step with all six components.

Parameter vector p, ``(4 n + 12,)``, SI units: for each axis pos_x, pos_y (m), rot_x, rot_y (rad); then for
B and for E pos_x, pos_y, pos_z, rot_x, rot_y, rot_z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath import lie
from truepath.lie import Array
from truepath.robot import NominalRobot

AXIS_FIELDS = ("pos_x", "pos_y", "rot_x", "rot_y")
FRAME_FIELDS = ("pos_x", "pos_y", "pos_z", "rot_x", "rot_y", "rot_z")


@dataclass(frozen=True)
class ParameterName:
    """One entry of the parameter vector: ``group`` is ``axis``, ``base`` or ``tool``; joints count from 1."""

    group: str
    field: str
    joint: int | None

    @property
    def unit(self) -> str:
        return "m" if self.field.startswith("pos") else "rad"

    @property
    def prior_scale(self) -> float:
        """A plausible size of the deviation, for scaling: 1 mm and 1 mrad for an axis, ten times that for a frame."""
        return 1e-3 if self.group == "axis" else 1e-2

    def __str__(self) -> str:
        return f"axis{self.joint}.{self.field}" if self.group == "axis" else f"{self.group}.{self.field}"


def parameter_names(num_joints: int) -> tuple[ParameterName, ...]:
    axes = [ParameterName("axis", f, i + 1) for i in range(num_joints) for f in AXIS_FIELDS]
    frames = [ParameterName(group, f, None) for group in ("base", "tool") for f in FRAME_FIELDS]
    return tuple(axes + frames)


def base_slice(num_joints: int) -> slice:
    return slice(4 * num_joints, 4 * num_joints + 6)


def tool_slice(num_joints: int) -> slice:
    return slice(4 * num_joints + 6, 4 * num_joints + 12)


def frame_step(step: Array) -> Array:
    """``X(step)``, ``(4, 4)``, of (pos_x, pos_y, pos_z, rot_x, rot_y, rot_z): shift, then Rx Ry Rz."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(step[3:]), np.cos(step[3:])
    rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return lie.make_pose(rx @ ry @ rz, step[:3])


def calibrated_axes(robot: NominalRobot, p: Array) -> Array:
    """``(n, 4, 4)`` axis frames at zero configuration, in the calibrated base frame."""
    axes = []
    for i, X_BA in enumerate(robot.X_BA):
        px, py, rx, ry = p[4 * i : 4 * i + 4]
        axes.append(X_BA @ frame_step(np.array([px, py, 0.0, rx, ry, 0.0])))
    return np.stack(axes)


def flange_poses(robot: NominalRobot, p: Array, phi_rad: Array) -> Array:
    """``(N, 4, 4)`` poses X_BF of the flange in the robot base for true joint angles ``(N, n)``."""
    return axis_and_flange_poses(robot, p, phi_rad)[1]


def axis_and_flange_poses(robot: NominalRobot, p: Array, phi_rad: Array) -> tuple[Array, Array]:
    """Axis frames X_BA ``(N, n, 4, 4)``, each before its own joint turns, and the flange X_BF ``(N, 4, 4)``."""
    links = link_transforms(calibrated_axes(robot, p), robot.X_BF)
    phi_rad = np.atleast_2d(phi_rad)
    cos, sin = np.cos(phi_rad), np.sin(phi_rad)
    X = np.broadcast_to(np.eye(4), (len(phi_rad), 4, 4))
    X_BA = np.empty((*phi_rad.shape, 4, 4))
    for i in range(phi_rad.shape[1]):
        X = X_BA[:, i] = X @ links[i]
        # Rotation about the local z: only the first two columns change.
        c, s = cos[:, i, None], sin[:, i, None]
        X = np.stack([X[:, :, 0] * c + X[:, :, 1] * s, X[:, :, 1] * c - X[:, :, 0] * s, X[:, :, 2], X[:, :, 3]], axis=2)
    return X_BA, X @ links[-1]


def flange_poses_and_jacobian(robot: NominalRobot, p: Array, phi_rad: Array) -> tuple[Array, Array]:
    """Flange poses ``(N, 4, 4)`` and their Jacobian ``(N, 6, n)``: rotation and velocity of the flange origin, in B."""
    X_BA, X_BF = axis_and_flange_poses(robot, p, phi_rad)
    axes = X_BA[:, :, :3, 2]
    linear = np.cross(axes, X_BF[:, None, :3, 3] - X_BA[:, :, :3, 3])
    return X_BF, np.concatenate([np.swapaxes(axes, 1, 2), np.swapaxes(linear, 1, 2)], axis=1)


def link_transforms(axes_0: Array, X_end: Array) -> Array:
    """``(n + 1, 4, 4)`` poses of each axis frame in the one before it, from base to end, at zero configuration."""
    inverse_0 = lie.invert(axes_0)
    return np.concatenate([axes_0[:1], inverse_0[:-1] @ axes_0[1:], (inverse_0[-1] @ X_end)[None]])
