"""Inverse kinematics by Newton's method, for all waypoints at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from truepath import lie
from truepath.errors import CorrectionError
from truepath.lie import Array
from truepath.model import nominal_model
from truepath.region import Region
from truepath.robot import NominalRobot

ForwardAndJacobian = Callable[[Array], tuple[Array, Array]]

POSITION_TOLERANCE_M = 1e-9
ANGLE_TOLERANCE_RAD = 1e-9
MAX_STEP_RAD = 0.3
STARTS, MOST_POSTURES = 512, 16
FIRST_BLOCK, LARGEST_BLOCK = 16, 4096
MAX_PATH_STEP_RAD = 0.35  # between neighbouring waypoints; more is another branch, or no path


@dataclass(frozen=True)
class InverseSolution:
    """Joints that reach goals.

    Attributes:
        q_rad: ``(N, n)``.
        converged: ``(N,)`` True where position and angle error are below 1e-9 m and 1e-9 rad.
        position_error_m, angle_error_rad: ``(N,)`` what is left.
        smallest_singular_value: ``(N,)`` of the Jacobian with lengths in units of a metre; 0 at a singularity.
    """

    q_rad: Array
    converged: Array
    position_error_m: Array
    angle_error_rad: Array
    smallest_singular_value: Array


def solve(forward: ForwardAndJacobian, X_goal: Array, q_start: Array, *, max_iterations: int = 30) -> InverseSolution:
    """Newton's method from a start that is near; stays on its arm branch because steps are small.

    Redundant arms take the shortest joint step (pseudo-inverse).

    Args:
        forward: joints ``(K, n)`` to poses ``(K, 4, 4)`` and Jacobian ``(K, 6, n)`` (angular, linear).
        X_goal: ``(N, 4, 4)``.
        q_start: ``(N, n)``.
    """
    q = np.array(q_start, float)
    error = np.full((len(q), 6), np.inf)
    jacobian = np.zeros((len(q), 6, q.shape[1]))
    active = np.arange(len(q))
    for iteration in range(max_iterations + 1):
        X, J = forward(q[active])
        error[active] = lie.pose_error(X_goal[active], X)
        jacobian[active] = J
        done = _within_tolerance(error[active])
        active, J = active[~done], J[~done]
        if len(active) == 0 or iteration == max_iterations:
            break
        J_t = np.swapaxes(J, 1, 2)
        # A breath of damping: exact to 1e-12 away from singularities, finite at them.
        step = (J_t @ np.linalg.solve(J @ J_t + 1e-12 * np.eye(6), error[active, :, None]))[..., 0]
        longest = np.abs(step).max(axis=1, keepdims=True)
        q[active] += step * np.minimum(1.0, MAX_STEP_RAD / np.maximum(longest, 1e-300))
    angle, position = np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1)
    smallest = np.linalg.svd(jacobian, compute_uv=False)[:, -1]
    return InverseSolution(q, _within_tolerance(error), position, angle, smallest)


def _within_tolerance(error: Array) -> Array:
    angle, position = np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1)
    return (angle < ANGLE_TOLERANCE_RAD) & (position < POSITION_TOLERANCE_M)


def joints_along_path(
    robot: NominalRobot, X_BF: Array, prefer: Region, line: Array, file: str, q_start: Array | None = None
) -> Array:
    """Nominal joints ``(N, n)`` for a path of flange poses ``(N, 4, 4)``, all on one arm branch.

    The postures that reach the first waypoint are tried in turn, the one nearest to the joints that
    ``prefer`` is about first, until the whole path can be followed. A joint that would run into its limit
    starts a whole turn away from it if that gives it the room. If ``q_start`` ``(n,)`` is given, the posture nearest
    to it is the only one.

    Raises:
        CorrectionError: a waypoint out of reach or beyond a limit, or the path leaves every branch; with its line.
    """
    failures: list[CorrectionError] = []
    postures = _postures(robot, X_BF[0], prefer, int(line[0]), file)
    if q_start is not None:
        postures = postures[[int(np.argmin(np.linalg.norm(lie_in_turns(postures - q_start), axis=1)))]]
    for q_first in postures:
        try:
            return _within_limits(robot, _follow(robot, X_BF, q_first, line, file), line, file)
        except CorrectionError as error:
            failures.append(error)
    raise max(failures, key=lambda error: error.line or 0)


def lie_in_turns(angles: Array) -> Array:
    """The same angles, rad, between half a turn below and above zero."""
    return angles - 2 * np.pi * np.round(angles / (2 * np.pi))


def _follow(robot: NominalRobot, X_BF: Array, q_first: Array, line: Array, file: str) -> Array:
    """Follows the path from its first joints, in blocks that each start from the last joints known; knows no limits."""
    forward = nominal_model(robot).flange_poses_and_jacobian
    q = np.empty((len(X_BF), robot.num_joints))
    q[0] = q_first
    known, block = 1, FIRST_BLOCK
    while known < len(X_BF):
        end = min(known + block, len(X_BF))
        start = np.broadcast_to(q[known - 1], (end - known, robot.num_joints))
        solution = solve(forward, X_BF[known:end], start)
        steps = np.abs(np.diff(np.concatenate([q[known - 1 : known], solution.q_rad]), axis=0)).max(axis=1)
        good = solution.converged & (steps < MAX_PATH_STEP_RAD)
        accepted = len(good) if good.all() else int(np.argmin(good))
        q[known : known + accepted] = solution.q_rad[:accepted]
        if accepted == 0 and block == 1:
            raise CorrectionError(
                "the path cannot be followed to this waypoint on one arm branch",
                file=file,
                line=int(line[known]),
                expected=f"a reachable pose, no joint stepping by {np.degrees(MAX_PATH_STEP_RAD):.0f} deg or more",
                found=f"{1e3 * solution.position_error_m[0]:.3f} mm missing, step {np.degrees(steps[0]):.1f} deg",
            )
        known += accepted
        block = min(2 * block, LARGEST_BLOCK) if good.all() else max(1, accepted // 2, block // 8)
    return q


def _within_limits(robot: NominalRobot, q: Array, line: Array, file: str) -> Array:
    """The same path ``(N, n)``, joints turned by whole turns where that brings all of it within the limits."""
    turn = 2 * np.pi
    least = np.ceil((robot.lower_rad - q.min(axis=0)) / turn)
    most = np.floor((robot.upper_rad - q.max(axis=0)) / turn)
    if (least > most).any():
        k, i = np.argwhere(((q < robot.lower_rad) | (q > robot.upper_rad)) & (least > most))[0]
        raise CorrectionError(
            "the path cannot be followed to this waypoint within the joint limits",
            file=file,
            line=int(line[k]),
            column=f"q{i + 1} ({robot.joint_names[i]})",
            expected=f"{robot.lower_rad[i]:.6f} to {robot.upper_rad[i]:.6f} rad",
            found=f"{q[k, i]:.6f} rad",
        )
    return q + turn * np.clip(0.0, least, most)


def _postures(robot: NominalRobot, X_BF: Array, prefer: Region, line: int, file: str) -> Array:
    """``(K, n)`` different joints for one flange pose, the ones nearest to ``prefer`` first."""
    rng = np.random.default_rng(0)
    lower, upper = np.maximum(robot.lower_rad, -2 * np.pi), np.minimum(robot.upper_rad, 2 * np.pi)
    spread = rng.uniform(np.maximum(lower, -np.pi), np.minimum(upper, np.pi), (STARTS, robot.num_joints))
    near = prefer.mean_rad + rng.normal(scale=0.5, size=(STARTS // 4, robot.num_joints))
    starts = np.concatenate([prefer.mean_rad[None], near, spread])
    goals = np.broadcast_to(X_BF, (len(starts), 4, 4))
    solution = solve(nominal_model(robot).flange_poses_and_jacobian, goals, starts, max_iterations=60)
    # The same posture a whole turn away is another solution; take the one nearest to what was measured.
    q = solution.q_rad - 2 * np.pi * np.round((solution.q_rad - prefer.mean_rad) / (2 * np.pi))
    q = np.where(q > upper, q - 2 * np.pi, np.where(q < lower, q + 2 * np.pi, q))
    usable = solution.converged & ((q >= lower) & (q <= upper)).all(axis=1)
    if not usable.any():
        raise CorrectionError(
            "the first waypoint cannot be reached",
            file=file,
            line=line,
            expected=f"a flange pose within reach of {robot.name}, in its base frame",
            found=f"closest {1e3 * float(solution.position_error_m.min()):.1f} mm away",
        )
    q = q[usable]
    different = q[np.unique(np.round(q, 6), axis=0, return_index=True)[1]]
    return different[np.argsort(prefer.distance(different), kind="stable")][:MOST_POSTURES]
