"""The correction of one pose, fast enough for a control loop: the model as one CasADi function, and Newton's method.

The same robot as ``CalibratedModel`` and the same iteration as ``inverse.solve``, for a single pose of which nothing
but the joints is known. Networks are a function of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from truepath import inverse, poe
from truepath.context import Context
from truepath.effects import EFFECTS
from truepath.effects.base import FittedTerm, constant_names, fading_limits, pose_function
from truepath.effects.readings import readings
from truepath.kinematics.gravity import gravity_moments
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.motions import Moves
from truepath.region import FADE_RAD

MOST_EVALUATIONS = 12
MOMENTS = ("moment_x", "moment_y", "gravity_torque")
DAMPING = 1e-12  # as ``inverse.solve`` has it


class SolvedPose(NamedTuple):
    """Joints ``(n,)`` for one pose, whether they reach it, and how far the flange moved in nominal kinematics, m."""

    q_rad: Array
    converged: bool
    displacement_m: float


class OnePose:
    """Solves for one pose at a time; what it finds depends on nothing that it found before. For one thread.

    Args:
        model: the calibrated robot, with six joints or more.
    """

    def __init__(self, model: CalibratedModel) -> None:
        n = model.robot.num_joints
        self._programmed, self._q, self._shift = np.zeros(n), np.zeros(n), np.zeros(6)
        self._step, self._left = np.zeros(n), np.zeros(3)
        self._buffer, self._evaluate = newton_step(model).buffer()
        for index, array in enumerate((self._programmed, self._q, self._shift)):
            self._buffer.set_arg(index, memoryview(array))  # type: ignore[call-arg, arg-type]
        for index, array in enumerate((self._step, self._left)):
            self._buffer.set_res(index, memoryview(array))  # type: ignore[call-arg, arg-type]
        self._ask_networks: Callable[[], None] | None = None
        if model.residual is not None:
            from truepath.host.one_pose_networks import network_shift  # torch takes a second to import

            self._networks, self._ask_networks = network_shift(model.residual).buffer()
            self._networks.set_arg(0, memoryview(self._q))  # type: ignore[call-arg, arg-type]
            self._networks.set_res(0, memoryview(self._shift))  # type: ignore[call-arg, arg-type]

    def solve(self, q_rad: Array) -> SolvedPose:
        """For programmed joints ``(n,)``."""
        self._programmed[:] = self._q[:] = q_rad
        converged = False
        if np.isfinite(self._q).all():
            for _ in range(MOST_EVALUATIONS):
                if self._ask_networks is not None:
                    self._ask_networks()
                self._evaluate()
                angle, position, _ = self._left.tolist()
                if angle < inverse.ANGLE_TOLERANCE_RAD and position < inverse.POSITION_TOLERANCE_M:
                    converged = True
                    break
                longest = float(np.abs(self._step).max())
                if not longest < np.inf:
                    break
                if longest > inverse.MAX_STEP_RAD:
                    self._step *= inverse.MAX_STEP_RAD / longest
                self._q += self._step
        return SolvedPose(self._q.copy(), converged, float(self._left[2]))


@lru_cache(maxsize=8)
def newton_step(model: CalibratedModel) -> ca.Function:
    """CasADi function of one pose.

    Inputs: programmed joints ``(n)``; joints ``(n)``; shift and turn of the probe by networks there ``(6)``, m and rad.

    Outputs: Newton's step of the joints ``(n)``, rad; ``(3)`` angle, rad, and distance, m, of the real flange from
    where it should be, and distance of the nominal flange at these joints from that at the programmed ones, m.
    """
    n = model.robot.num_joints
    programmed, q, shift = ca.SX.sym("programmed", n), ca.SX.sym("q", n), ca.SX.sym("shift", 6)
    X_BB, X_FF = model.goal_frames()
    nominal = poe.link_transforms(model.robot.X_BA, model.robot.X_BF)
    R_meant, p_meant, _ = _chain(nominal, programmed)
    R_goal, p_goal = _times(*_times(X_BB[:3, :3], X_BB[:3, 3], R_meant, p_meant), X_FF[:3, :3], X_FF[:3, 3])
    R, p, axes = real_flange(model, q, shift)
    D = ca.mtimes(R_goal, R.T)
    vee = ca.vertcat(D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1])
    # 2 sin(a/2) times the axis: the rotation vector to within a^3/24.
    turn = vee / ca.sqrt(ca.fmax(1.0 + ca.trace(D), 1e-9))
    J = ca.horzcat(*(ca.vertcat(R_A[:, 2], ca.cross(R_A[:, 2], p - p_A)) for R_A, p_A in axes))
    error = ca.vertcat(turn, p_goal - p)
    squares = ca.densify(ca.mtimes(J, J.T) + DAMPING * ca.SX.eye(6))
    diagonal, upper, order = ca.ldl(squares)
    step = ca.mtimes(J.T, ca.ldl_solve(error, diagonal, upper, order))
    moved = _chain(nominal, q)[1] - p_meant
    left = ca.vertcat(ca.norm_2(turn), ca.norm_2(p_goal - p), ca.norm_2(moved))
    outputs = ca.cse([ca.densify(step), ca.densify(left)])
    return ca.Function("newton_step", [programmed, q, shift], outputs)


Frame = tuple[ca.SX, ca.SX]  # rotation (3, 3) and origin (3)


def real_flange(model: CalibratedModel, q: ca.SX, shift: ca.SX) -> tuple[ca.SX, ca.SX, list[Frame]]:
    """Rotation and origin of the real flange in the real base, and the axis frames, each before its joint turns."""
    motions = _motions(model, q)
    errors = [motions[Moves.JOINT, i] if (Moves.JOINT, i) in motions else ca.SX(0) for i in range(q.shape[0])]
    R, p, axes = _chain(
        poe.link_transforms(poe.calibrated_axes(model.robot, model.p), model.robot.X_BF), q + ca.vertcat(*errors)
    )
    moved, turned = ca.SX.zeros(3), ca.SX.zeros(3)  # small motions of the flange, as ``motions`` has them
    for (moves, i), motion in motions.items():
        if moves is Moves.AXIS:
            R_A, p_A = axes[i]
            turn = ca.mtimes(R_A[:, :2], motion[3:5])
            moved += ca.mtimes(R_A, motion[:3]) + ca.cross(turn, p - p_A)
            turned += turn
        elif moves is Moves.ROBOT_LENGTHS:
            moved += motion * p
    if any(moves is not Moves.JOINT for moves, _ in motions):
        R, p = ca.mtimes(_rotation(turned), R), p + moved
    if model.residual is not None:
        p_FE = model.X_FE[:3, 3] if model.residual.p_FE is None else model.residual.p_FE
        p_E = p + ca.mtimes(R, p_FE) + shift[:3]
        R = ca.mtimes(_rotation(shift[3:]), R)
        p = p_E - ca.mtimes(R, p_FE)
    return R, p, axes


def _motions(model: CalibratedModel, q: ca.SX) -> dict[tuple[Moves, int], ca.SX]:
    """What the effects move, by joint from 0, or -1 for what belongs to none."""
    robot = model.robot
    kinds = (Moves.JOINT, Moves.AXIS, Moves.ROBOT_LENGTHS)
    parts = [part for part in model.effects if part.term.moves in kinds]
    moments = None
    if any(name in MOMENTS for part in parts for name in part.term.inputs):
        moments = gravity_moments(robot, ca.sin(q), ca.cos(q), model.payload_kg)
    found: dict[tuple[Moves, int], ca.SX] = {}
    nowhere = Context(np.zeros((1, robot.num_joints)))  # of a pose to come nothing is recorded

    def reading(part: FittedTerm, name: str) -> ca.SX | float:
        own = (part.term.joint or 1) - 1
        if name in MOMENTS:
            assert moments is not None
            return moments[own][MOMENTS.index(name)]
        if name == "theta":
            return q[own]
        if name[0] == "q" and name[1:].isdigit():
            return q[int(name[1:]) - 1]
        return float(readings(robot, nowhere, (name,), part.term.joint, dict(part.term.constants))[0][0])

    for part in parts:
        term = part.term
        inputs = [reading(part, name) for name in term.inputs] or [0.0]
        constants = [term.constant(name) for name in constant_names(term)]
        motion = ca.mtimes(ca.SX(pose_function(EFFECTS[term.effect], term)(*inputs, *constants)), part.values)
        limits = fading_limits(term)
        if limits is not None:
            motion = motion * _fade(q[(term.joint or 1) - 1], *limits)
        place = (term.moves, -1 if term.joint is None else term.joint - 1)
        found[place] = found[place] + motion if place in found else motion
    return found


def _fade(theta: ca.SX, lower: float, upper: float) -> ca.SX:
    """``region.fade``."""
    t = ca.fmin(ca.fmax(1.0 - ca.fmax(lower - theta, theta - upper) / FADE_RAD, 0.0), 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t**2)


def _chain(links: Array, phi: ca.SX) -> tuple[ca.SX, ca.SX, list[Frame]]:
    """The end of a chain of ``(n + 1, 4, 4)`` links at angles ``(n)``, and its axis frames."""
    R, p = ca.SX.eye(3), ca.SX.zeros(3)
    axes = []
    for i, link in enumerate(links):
        R, p = _times(R, p, link[:3, :3], link[:3, 3])
        if i < phi.shape[0]:
            axes.append((R, p))
            c, s = ca.cos(phi[i]), ca.sin(phi[i])
            R = ca.horzcat(R[:, 0] * c + R[:, 1] * s, R[:, 1] * c - R[:, 0] * s, R[:, 2])
    return R, p, axes


def _times(R: ca.SX | Array, p: ca.SX | Array, R_next: ca.SX | Array, p_next: ca.SX | Array) -> Frame:
    return ca.mtimes(ca.SX(R), ca.SX(R_next)), ca.mtimes(ca.SX(R), ca.SX(p_next)) + ca.SX(p)


def _rotation(vector: ca.SX) -> ca.SX:
    """Of a small rotation vector, exact to the last bits up to 0.1 rad."""
    square = ca.dot(vector, vector)
    sine = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
    rest = 0.5 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)))
    W = ca.skew(vector)
    return ca.SX.eye(3) + sine * W + rest * ca.mtimes(W, W)
