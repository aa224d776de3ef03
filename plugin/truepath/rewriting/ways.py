"""The ways between targets: lines and arcs of the tool, sampled, so that what lies between them is corrected too.

A controller goes straight in its own kinematics from one corrected target to the next. On the real robot that is not
straight, because the correction that the points between would need is not the mean of that at the ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath import inverse, lie
from truepath.controller import Controller
from truepath.correct import correct
from truepath.guards import Finding
from truepath.lie import Array
from truepath.model import CalibratedModel, nominal_model
from truepath.posture_polish import newton
from truepath.rewriting.arcs import Arc, arcs_of
from truepath.rewriting.plan import Plan, flange_of, tool_poses_meant, with_tool_of
from truepath.robot import NominalRobot

# The correction of a real robot bends by 1e-4 per mm at most (gear waves of 0.05 mm over 100 mm): 0.005 mm in 20 mm.
SPACING_M, SHORT_M = 0.020, 0.005
ARC_STEPS = 48  # divisible by twice 1, 2, 3, 4, 6, 8, 12
MOST_SAMPLES = 512
STEPS_AT_ONCE = 3  # of Newton's method, for all samples; few need more


@dataclass(frozen=True, eq=False)
class Ways:
    """W ways with S samples between their ends.

    Attributes:
        target: ``(W,)`` index of the target at the end.
        start: ``(W,)`` index of the target from which they come.
        length_m, turn_rad: ``(W,)``.
        arcs: of the ways that are arcs, by way.
        first: ``(W + 1,)`` where the samples of each way begin.
        share: ``(S,)`` of the way, between 0 and 1.
        X_CT: ``(S, 4, 4)`` where the program means the tool to be.
        q_rad: ``(S, n)`` nominal joints there.
        q_corrected_rad: ``(S, n)``.
        X_CT_commanded: ``(S, 4, 4)`` where the controller must believe the tool to be.
        followed: ``(W,)`` False where the nominal robot cannot follow the way.
    """

    target: Array
    start: Array
    length_m: Array
    turn_rad: Array
    arcs: dict[int, Arc]
    first: Array
    share: Array
    X_CT: Array
    q_rad: Array
    q_corrected_rad: Array
    X_CT_commanded: Array
    followed: Array

    def samples(self, way: int) -> slice:
        return slice(int(self.first[way]), int(self.first[way + 1]))


def sample_ways(
    plan: Plan, model: CalibratedModel, controller: Controller, max_correction_mm: float, file: str
) -> tuple[Ways, list[Finding]]:
    """All lines and arcs whose start is known, and what is worth a warning.

    Raises:
        CorrectionError: a point on the way whose correction passes a limit; with the line of the target.
    """
    motions = plan.motions
    arcs, findings = arcs_of(plan, tool_poses_meant(plan, controller))
    straight = np.flatnonzero(motions.is_straight & (motions.previous >= 0))
    target = np.concatenate([straight, np.array(list(arcs), int)])
    start = np.concatenate([motions.previous[straight], np.array([arc.start for arc in arcs.values()], int)])
    order = np.argsort(target, kind="stable")
    target, start = target[order], start[order]
    by_way = {way: arcs[int(at)] for way, at in enumerate(target.tolist()) if at in arcs}
    ways = sampled(plan, start, target, by_way, model, controller, max_correction_mm, file)
    findings += [
        Finding("warning", "path", int(motions.line[at]), "the nominal robot cannot follow the way to this target: a "
                "singularity or a joint limit lies on it; nothing was added there")
        for at in target[~ways.followed]
    ]  # fmt: skip
    return ways, findings


def sampled(
    plan: Plan,
    start: Array,
    target: Array,
    by_way: dict[int, Arc],
    model: CalibratedModel,
    controller: Controller,
    max_correction_mm: float,
    file: str,
) -> Ways:
    """The ways between targets ``(W,)`` and others ``(W,)``: lines, but for those that are arcs.

    Raises:
        CorrectionError: see ``sample_ways``.
    """
    motions = plan.motions
    X_CT = tool_poses_meant(plan, controller)
    # With another tool in force than before, the line begins where the new tool is.
    X_start = with_tool_of(motions, X_CT, start, target)
    turn = lie.rotation_vector(lie.invert(X_start)[:, :3, :3] @ X_CT[target][:, :3, :3])
    turn_rad = np.linalg.norm(turn, axis=1)
    shift = X_CT[target][:, :3, 3] - X_start[:, :3, 3]
    length = np.linalg.norm(shift, axis=1)
    counts = _counts(np.maximum(length, 0.1 * turn_rad))
    for at, arc in by_way.items():
        length[at], counts[at] = arc.length_m, ARC_STEPS - 1
    first = np.concatenate([[0], np.cumsum(counts)])
    way = np.repeat(np.arange(len(target)), counts)
    share = (np.arange(first[-1]) - first[way] + 1) / (counts[way] + 1)

    X = lie.make_pose(
        X_start[way, :3, :3] @ lie.from_rotation_vector(share[:, None] * turn[way]),
        X_start[way, :3, 3] + share[:, None] * shift[way],
    )
    for each, arc in by_way.items():
        part = slice(first[each], first[each + 1])
        X[part, :3, 3] = arc.points(share[part])
    X_0T = motions.X_0T[target][way]
    guess = plan.q_rad[start][way] + share[:, None] * (plan.q_rad[target] - plan.q_rad[start])[way]
    q, reached = _nominal_joints(model.robot, flange_of(X, X_0T, controller), guess)
    followed = _followed(q, reached, way, len(target), plan, start, target)
    usable = followed[way]
    q = np.where(usable[:, None], q, guess)
    corrected, commanded = q.copy(), X.copy()
    if usable.any():
        line = motions.line[target][way][usable]
        neighbour = np.where(np.diff(way[usable], prepend=-1) == 0, np.arange(usable.sum()) - 1, -1)
        corrected[usable] = correct(
            model, q[usable], line=line, file=file, max_correction_mm=max_correction_mm, previous=neighbour
        ).q_rad
        commanded[usable] = controller.tool_poses(corrected[usable], X_0T[usable])
    return Ways(target, start, length, turn_rad, by_way, first, share, X, q, corrected, commanded, followed)


def _nominal_joints(robot: NominalRobot, X_BF: Array, guess: Array) -> tuple[Array, Array]:
    """Joints ``(S, n)`` near a guess that reach poses ``(S, 4, 4)``, and where they do ``(S,)``."""
    q, reached = newton(robot, X_BF, guess, steps=STEPS_AT_ONCE)
    rest = np.flatnonzero(~reached)
    if len(rest):
        solution = inverse.solve(nominal_model(robot).flange_poses_and_jacobian, X_BF[rest], q[rest])
        q[rest], reached[rest] = solution.q_rad, solution.converged
    return q, reached


def _counts(length_m: Array) -> Array:
    """Samples between the ends: so many that a quarter, half and three quarters are among them, or none."""
    counts = 4 * np.ceil(length_m / (4 * SPACING_M)).astype(int) - 1
    return np.where(length_m < SHORT_M, 0, np.minimum(counts, MOST_SAMPLES - 1))


def _followed(q: Array, converged: Array, way: Array, ways: int, plan: Plan, start: Array, target: Array) -> Array:
    """``(W,)`` True where all samples were reached without a leap from one to the next."""
    good = np.ones(ways, bool)
    if not len(q):
        return good
    bad = ~converged
    begins = np.diff(way, prepend=-1) != 0
    ends = np.append(begins[1:], True)
    before = np.where(begins[:, None], plan.q_rad[start][way], np.roll(q, 1, axis=0))
    bad |= np.abs(q - before).max(axis=1) > inverse.MAX_PATH_STEP_RAD
    bad |= ends & (np.abs(plan.q_rad[target][way] - q).max(axis=1) > inverse.MAX_PATH_STEP_RAD)
    good[way[bad]] = False
    return good
