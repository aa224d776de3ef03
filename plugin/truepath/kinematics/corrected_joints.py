"""Joints that bring the calibrated robot where programmed joints mean the tool to be, for a whole path at once."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from queue import SimpleQueue

import numpy as np

from truepath import inverse
from truepath.kinematics.arm_rows import ArmRows
from truepath.kinematics.blocks import BLOCK
from truepath.kinematics.inverse_rows import InverseRows
from truepath.lie import Array
from truepath.model import CalibratedModel, nominal_flange_poses

MOST_ROWS = 8192  # waypoints at a time
EVALUATIONS, MORE_EVALUATIONS = 3, 8
LEAST_STEP_RAD = 1e-7  # of a joint, to tell how its error changes with it
LARGEST_SLOPE = 0.1
LARGEST_LAST_MISS = 1e-7  # m and rad: with less, a last step needs no evaluation behind it,
MARGIN = 10.0  # if what it should leave is that much below the tolerance
JACOBIAN_CHANGE = 8.0  # bounds by how much a singular value changes per rad that all joints together turn


@dataclass(frozen=True, eq=False)
class CorrectedJoints:
    """Joints for N waypoints, and what is known about them.

    Attributes:
        q_rad: ``(N, n)``.
        position_error_m, angle_error_rad: ``(N,)`` of the flange, left over.
        smallest_singular_value: ``(N,)`` of the Jacobian; where above ``exact_below`` only a lower bound that is
            above it too.
        error_before_mm, error_after_mm: ``(N,)`` predicted distance of the tool point from where it should be, at the
            programmed and at these joints.
        displacement_mm: ``(N,)`` how far the flange moved in nominal kinematics.
    """

    q_rad: Array
    position_error_m: Array
    angle_error_rad: Array
    smallest_singular_value: Array
    error_before_mm: Array
    error_after_mm: Array
    displacement_mm: Array


def corrected_joints(model: CalibratedModel, q_rad: Array, *, exact_below: float) -> CorrectedJoints:
    """Solves for programmed joints ``(N, n)``, each on its own: what one gives does not depend on the others.

    Three evaluations of the model bring nearly every waypoint within ``inverse``'s tolerances, with one Jacobian whose
    inverse is corrected for the next. What they do not bring there gets more of them, and then Newton's method as
    ``inverse.solve`` has it; so do redundant arms.

    Args:
        model: the calibrated robot.
        q_rad: what they reach in nominal kinematics is what the program means.
        exact_below: singular values below this are exact.
    """
    found = _Table(len(q_rad), model.robot.num_joints)
    left = np.arange(len(q_rad))
    for evaluations in (EVALUATIONS, MORE_EVALUATIONS) if model.robot.num_joints == 6 else ():
        _by_rows(model, q_rad, left, evaluations, found)
        left = left[~found.done[left]]
    if len(left):
        _by_newton(model, q_rad, left, found)
    near = np.flatnonzero(found.smallest_singular_value < exact_below)
    if len(near):
        jacobian = model.flange_poses_and_jacobian(found.q_rad[near])[1]
        found.smallest_singular_value[near] = np.linalg.svd(jacobian, compute_uv=False)[:, -1]
    return CorrectedJoints(**{field.name: getattr(found, field.name) for field in fields(CorrectedJoints)})


class _Table:
    """What ``CorrectedJoints`` has, while it is filled, and which waypoints are done."""

    def __init__(self, count: int, num_joints: int) -> None:
        self.q_rad = np.empty((count, num_joints))
        self.position_error_m, self.angle_error_rad = np.empty((2, count))
        self.smallest_singular_value = np.zeros(count)
        self.error_before_mm, self.error_after_mm, self.displacement_mm = np.empty((3, count))
        self.done = np.zeros(count, bool)


def _by_rows(model: CalibratedModel, q_rad: Array, waypoints: Array, evaluations: int, found: _Table) -> None:
    """On all cores: numpy lets go of the interpreter while it works on a row."""
    workers = max(1, min(_cores(), -(-len(waypoints) // BLOCK)))
    count = min(MOST_ROWS, BLOCK * -(-len(waypoints) // (workers * BLOCK)))
    parts = [waypoints[k : k + count] for k in range(0, len(waypoints), max(count, 1))]
    free: SimpleQueue[_Rows] = SimpleQueue()

    def solve(own: Array) -> None:
        rows = free.get()
        with np.errstate(all="ignore"):  # what is no number is left to Newton's method
            rows.solve(q_rad[own], own, evaluations, found)
        free.put(rows)

    workers = min(workers, len(parts))
    for _ in range(workers):
        free.put(_Rows(model, count))
    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(solve, parts))
    else:
        for part in parts:
            solve(part)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Rows:
    """Memory for some waypoints, always as many: the same operations are done for each, whoever its neighbours are."""

    def __init__(self, model: CalibratedModel, count: int) -> None:
        self._count, self._arm, self._inverted = count, ArmRows(model, count), InverseRows(count)

    def solve(self, q_rad: Array, own: Array, evaluations: int, found: _Table) -> None:
        """Solves for ``(K, 6)`` programmed joints and writes what it finds about them to places ``own`` of a table."""
        arm, inverted, N = self._arm, self._inverted, self._count
        padded = np.concatenate([q_rad, np.broadcast_to(q_rad[-1:], (N - len(q_rad), 6))])
        nominal = arm.start(padded)
        arm.at(None)
        before_m, size = arm.tool_miss_m(), _size(arm.miss)
        at_rest = _within(arm.miss) & arm.valid  # already
        left = _Left(arm, at_rest, before_m)
        jacobian, start_errors = arm.jacobian(), arm.errors.copy()
        inverted.of(jacobian)
        bound = inverted.least_singular_value()
        change = inverted.applied(arm.miss).astype(float)
        change[:, at_rest] = 0.0
        slope: Array | float = 1.0
        for evaluation in range(1, 1 if at_rest.all() else evaluations):
            last = evaluation == evaluations - 1
            arm.at(change)
            earlier, size = size, _size(arm.miss)
            if evaluation == 1:
                before, jacobian = jacobian, arm.jacobian()
                bound -= _norm(np.subtract(before, jacobian, out=before))
                slope = 1.0 + _slope(arm.errors - start_errors, change)
            elif not last:
                jacobian = arm.jacobian()
            step = inverted.applied(arm.miss)
            # The inverse belongs to the start: what it leaves of the miss here is brought down once more.
            step += inverted.applied(arm.miss - np.add.reduce(np.multiply(jacobian, step[:, None], out=before), axis=0))
            step = step / slope
            step[:, left.done] = 0.0
            bound -= JACOBIAN_CHANGE * np.add.reduce(np.abs(step), axis=0)
            change += step
            # With this step one that is near enough is done; its miss falls by a share like that of the step before.
            left.note(arm, size / earlier, (size < LARGEST_LAST_MISS) if last else _within(arm.miss))
            if evaluation > 1 and left.done.all():
                break
        count = len(own)
        found.done[own] = left.done[:count]
        found.q_rad[own] = (padded + change.T)[:count]
        found.angle_error_rad[own], found.position_error_m[own] = left.angle_rad[:count], left.position_m[:count]
        found.smallest_singular_value[own] = bound[:count]
        found.error_before_mm[own], found.error_after_mm[own] = 1e3 * before_m[:count], 1e3 * left.tool_m[:count]
        found.displacement_mm[own] = 1e3 * _size(arm.nominal_positions(change) - nominal)[:count]


class _Left:
    """What is left of the miss of each pose when it is done.

    Attributes:
        done: ``(N,)``.
        position_m, angle_rad, tool_m: ``(N,)`` of the flange, and of the tool point.
    """

    def __init__(self, arm: ArmRows, at_rest: Array, tool_m: Array) -> None:
        self.done = at_rest.copy()
        self.angle_rad, self.position_m, self.tool_m = _size(arm.miss[:3]), _size(arm.miss[3:]), tool_m

    def note(self, arm: ArmRows, share: Array, near: Array) -> None:
        """Poses that are near their goal are done, if the share of their miss that a step leaves is small enough."""
        if not near.any():
            return
        new = near & arm.valid & ~self.done & _within(MARGIN * share * arm.miss)
        self.angle_rad = np.where(new, share * _size(arm.miss[:3]), self.angle_rad)
        self.position_m = np.where(new, share * _size(arm.miss[3:]), self.position_m)
        self.tool_m = np.where(new, share * arm.tool_miss_m(), self.tool_m)
        self.done |= new


def _slope(errors: Array, change: Array) -> Array:
    """By how much the error of each joint grows per rad of its own, as two evaluations tell."""
    steps = np.where(np.abs(change) < LEAST_STEP_RAD, np.inf, change)
    return np.clip(errors / steps, -LARGEST_SLOPE, LARGEST_SLOPE)


def _size(miss: Array) -> Array:
    return np.sqrt(np.add.reduce(np.square(miss), axis=0))


def _norm(jacobian: Array) -> Array:
    np.square(jacobian, out=jacobian)
    return np.sqrt(np.add.reduce(jacobian.reshape(36, -1), axis=0))


def _within(miss: Array) -> Array:
    square = np.square(miss)
    angle, position = np.add.reduce(square[:3], axis=0), np.add.reduce(square[3:], axis=0)
    return (angle < inverse.ANGLE_TOLERANCE_RAD**2) & (position < inverse.POSITION_TOLERANCE_M**2)


def _by_newton(model: CalibratedModel, q_rad: Array, rows: Array, found: _Table) -> None:
    start = q_rad[rows]
    nominal = nominal_flange_poses(model.robot, start)
    goal = model.goal_flange_poses(nominal)
    solution = inverse.solve(model.flange_poses_and_jacobian, goal, start)
    found.q_rad[rows] = solution.q_rad
    found.position_error_m[rows], found.angle_error_rad[rows] = solution.position_error_m, solution.angle_error_rad
    found.smallest_singular_value[rows] = solution.smallest_singular_value
    wanted = (goal @ model.X_FE)[:, :3, 3]
    for q, error_mm in ((start, found.error_before_mm), (solution.q_rad, found.error_after_mm)):
        error_mm[rows] = 1e3 * np.linalg.norm((model.flange_poses(q) @ model.X_FE)[:, :3, 3] - wanted, axis=1)
    commanded = nominal_flange_poses(model.robot, solution.q_rad)[:, :3, 3] - nominal[:, :3, 3]
    found.displacement_mm[rows] = 1e3 * np.linalg.norm(commanded, axis=1)
