"""The product of exponentials as a CasADi expression, and the calibration problem built on its exact derivatives.

What does not change from pose to pose (the axis frames, moved by the parameters) is worked out once, in
numpy; what does is one CasADi function of a pose. It differentiates with respect to small twists of the
frames, expressed in these frames, at zero: there most of the expression vanishes. A constant matrix then
leads from the parameters to the twists.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from truepath import lie, poe
from truepath.batched import BatchedFunction
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.robot import NominalRobot

Pose = tuple[ca.SX, ca.SX]  # rotation (3, 3) and translation (3, 1); only a point, no rotation, for 3D data


@lru_cache(maxsize=16)
def residual_function(num_joints: int, has_orientation: bool) -> ca.Function:
    """CasADi function of one pose of any arm with that many revolute joints.

    Inputs: links ``(3, 4 (n + 1))``, the upper three rows of the link transforms side by side, from the
    measurement frame to the probe; true joint angles ``(n)``; measured position ``(3)``, m; with
    orientation, measured rotation ``(3, 3)``.

    Outputs: residual, predicted minus measured, ``(3)`` in m, or ``(6)`` with a rotation vector in rad
    below, in the measurement frame; its Jacobian with respect to local twists (linear, angular):
    ``4 n`` columns (vx, vy, wx, wy of each axis), then six of the base at axis 1, and six of the probe.
    """
    n = num_joints
    links, phi, position = ca.SX.sym("links", 3, 4 * (n + 1)), ca.SX.sym("phi", n), ca.SX.sym("position", 3)
    twists = ca.SX.sym("twists", 4 * n + 12)
    inputs = [links, phi, position]
    t = twists[4 * n + 6 : 4 * n + 9]
    R = ca.SX.eye(3) + ca.skew(twists[4 * n + 9 : 4 * n + 12]) if has_orientation else None
    for i in range(n, -1, -1):
        link = links[:, 4 * i : 4 * i + 4]
        if i < n:
            vx, vy, wx, wy = (twists[4 * i + k] for k in range(4))
            v, w = ca.vertcat(vx, vy, 0), ca.vertcat(wx, wy, 0)
            R, t = _nudge(R, t, -v, -w)
            R, t = _turn(R, t, phi[i])
            R, t = _nudge(R, t, v, w)
            if i == 0:
                R, t = _nudge(R, t, twists[4 * n : 4 * n + 3], twists[4 * n + 3 : 4 * n + 6])
        R = None if R is None else link[:, :3] @ R
        t = link[:, :3] @ t + link[:, 3]
    residual = t - position
    if R is not None:
        R_measured = ca.SX.sym("R_measured", 3, 3)
        inputs.append(R_measured)
        D = R @ R_measured.T
        # 2 sin(a/2) times the axis: the rotation vector to within a^3/24, and monotone up to half a turn.
        vee = ca.vertcat(D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1])
        residual = ca.vertcat(residual, vee / ca.sqrt(ca.fmax(1 + ca.trace(D), 1e-9)))
    at_zero = ca.substitute([residual, ca.jacobian(residual, twists)], [twists], [ca.SX.zeros(twists.shape)])
    return ca.Function("residual", inputs, ca.cse([ca.densify(expression) for expression in at_zero]))


def _nudge(R: ca.SX | None, t: ca.SX, v: ca.SX, w: ca.SX) -> tuple[ca.SX | None, ca.SX]:
    """The pose moved by a small twist; first order is all that a derivative at zero needs."""
    return None if R is None else R + ca.skew(w) @ R, t + v + ca.cross(w, t)


def _turn(R: ca.SX | None, t: ca.SX, angle: ca.SX) -> tuple[ca.SX | None, ca.SX]:
    c, s = ca.cos(angle), ca.sin(angle)

    def about_z(m: ca.SX) -> ca.SX:
        return ca.vertcat(c * m[0, :] - s * m[1, :], s * m[0, :] + c * m[1, :], m[2, :])

    return None if R is None else about_z(R), about_z(t)


class PoseProblem:
    """Residuals of all poses of a data set and their Jacobian with respect to the parameters p of ``poe``.

    Base and probe are counted from reference poses X_MB and X_FE.
    """

    def __init__(self, robot: NominalRobot, measurements: Measurements, X_MB: Array, X_FE: Array) -> None:
        self.robot, self.X_MB, self.X_FE = robot, X_MB, X_FE
        self.components = 6 if measurements.has_orientation else 3
        n = robot.num_joints
        inputs = [np.zeros((4 * (n + 1), 3)), measurements.q_rad, measurements.p_ME]
        if measurements.R_ME is not None:
            inputs.append(np.swapaxes(measurements.R_ME, 1, 2))  # column-major, as CasADi wants it
        self._function = BatchedFunction(residual_function(n, measurements.has_orientation), inputs, common=(0,))
        self._q_rad = measurements.q_rad

    def evaluate(self, p: Array, joint_error_rad: Array | float = 0.0) -> tuple[Array, Array]:
        """Residual ``(N, m)`` and Jacobian ``(N, m, 4 n + 12)``, m = 3 or 6, in m and rad.

        Args:
            p: ``(4 n + 12,)`` parameters.
            joint_error_rad: ``(N, n)`` by how much the joints stand off from their commands.
        """
        n = self.robot.num_joints
        axes = poe.calibrated_axes(self.robot, p)
        X_BE = self.robot.X_BF @ self.X_FE @ poe.frame_step(p[poe.tool_slice(n)])
        links = poe.link_transforms(axes, X_BE)
        links[0] = self.X_MB @ poe.frame_step(p[poe.base_slice(n)]) @ links[0]
        self._function.inputs[0][:] = links[:, :3].transpose(0, 2, 1).reshape(-1, 3)
        self._function.inputs[1][:] = self._q_rad + joint_error_rad
        residual, local = self._function()
        by_parameter = np.swapaxes(local, 1, 2) @ _twists_of_parameters(axes, p)
        return residual[:, 0].copy(), by_parameter


def _twists_of_parameters(axes: Array, p: Array) -> Array:
    """``(4 n + 12, 4 n + 12)`` derivative of the local twists with respect to the parameters."""
    n = len(axes)
    D = np.zeros((4 * n + 12, 4 * n + 12))
    for i in range(n):
        px, py, rx, ry = p[4 * i : 4 * i + 4]
        own = slice(4 * i, 4 * i + 4)
        full = _twist_of_step(np.array([px, py, 0.0, rx, ry, 0.0]))
        # A twist along or about the axis itself commutes with the rotation and moves nothing.
        D[own, own] = full[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])]
    base, tool = poe.base_slice(n), poe.tool_slice(n)
    X_A1B = lie.invert(axes[0])
    to_axis_1 = np.zeros((6, 6))
    to_axis_1[:3, :3] = to_axis_1[3:, 3:] = X_A1B[:3, :3]
    to_axis_1[:3, 3:] = lie.skew(X_A1B[:3, 3]) @ X_A1B[:3, :3]
    D[base, base] = to_axis_1 @ _twist_of_step(p[base])
    D[tool, tool] = _twist_of_step(p[tool])
    return D


def _twist_of_step(step: Array) -> Array:
    """``(6, 6)`` local twist (linear, angular) of ``poe.frame_step(step)`` per unit change of the step."""
    R = poe.frame_step(step)[:3, :3]
    (_, sy, sz), (_, cy, cz) = np.sin(step[3:]), np.cos(step[3:])
    D = np.zeros((6, 6))
    D[:3, :3] = R.T
    D[3:, 3] = [cy * cz, -cy * sz, sy]  # (Ry Rz)^T e_x
    D[3:, 4] = [sz, cz, 0.0]  # Rz^T e_y
    D[3:, 5] = [0.0, 0.0, 1.0]
    return D
