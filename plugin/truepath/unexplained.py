"""Whether what is left has a pattern: by nameless forms, by repeats, by likeness of neighbours."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from truepath.context import Context
from truepath.diagnosis import Unexplained
from truepath.findings import LEAST_P, SIGNIFICANT, Evidence
from truepath.leftover import alike_by_chance, more_than_repeats, noise_floor_mm, spread
from truepath.lie import Array
from truepath.motions import ChainPoses, Moves
from truepath.nameless import NAMELESS
from truepath.unseen import UnseenPoses

A_PATTERN = 0.001  # p value of a pattern that no form describes


def unexplained(trial: UnseenPoses, evidence: Evidence) -> Unexplained:
    """What is left when all findings are in the model, and what is doubtful only by name."""
    fit = evidence.with_doubtful
    context = trial.fit.context.subset(fit.inlier)
    looked_at, residual = trial.fit.measurements.subset(fit.inlier), fit.residual[fit.inlier]
    p_alike = alike_by_chance(residual, fit.sigma, _likenesses(context), _views(trial, context))
    p_repeats = more_than_repeats(looked_at, residual)
    # What looked like a named cause and was none is a pattern all the same.
    p_forms = [evidence.p_values[name] for name in (*(t.effect for t in evidence.nameless), *evidence.unproved)]
    floor, source = noise_floor_mm(looked_at, residual)
    # The unseen poses are judged at the barycentres of their visits, which scatter less.
    visits = np.unique(trial.measurements.groups()[trial.unseen], return_counts=True)[1]
    floor *= float(np.mean(visits**-0.5))
    if source == "neighbours":  # a fit makes residuals smaller than the noise is
        readings = residual.size
        floor *= float(np.sqrt(readings / max(readings - len(fit.covariance) - len(fit.values), 1)))
        # Neighbours that arrived from different sides differ by more than noise: a floor is never above what is left.
        floor = min(floor, trial.mean(trial.final))
    places: dict[str, set[int]] = {}
    for term in evidence.nameless:
        places.setdefault(term.effect, set()).update([] if term.joint is None else [term.joint])
    hints = tuple(
        NAMELESS[name].hint + (f" (joint {', '.join(str(joint) for joint in sorted(joints))})" if joints else "")
        for name, joints in places.items()
    )
    return Unexplained(
        structured=min([*p_forms, 1.0]) < SIGNIFICANT or min(p_alike, p_repeats) < A_PATTERN,
        p_value=max(float(min([*p_forms, p_alike, p_repeats])), LEAST_P),
        heldout_mm=trial.mean(trial.final),
        noise_floor_mm=floor,
        floor_from=source,
        hints=hints,
    )


def _likenesses(context: Context) -> Iterator[Array]:
    """What poses can be alike in: all joints, one, two; time; the place of the probe; how the flange stands."""
    joints = spread(context.q_rad)
    yield joints
    yield np.arange(len(context))[:, None]
    for count in (1, 2):
        for some in combinations(range(joints.shape[1]), count):
            yield joints[:, list(some)]
    if context.p_ME is not None:
        yield context.p_ME
    if context.R_MF is not None:
        yield context.R_MF.reshape(-1, 9)


def _views(trial: UnseenPoses, context: Context) -> Iterator[Array]:
    """Axes in which an error may act: those of the flange, and the ways in which each joint moves the probe."""
    if context.R_MF is not None:
        yield context.R_MF
    final = trial.final
    chain = ChainPoses.of(final.robot, final.p, final.true_joints(context), final.X_MB, final.X_FE)
    for joint in range(1, final.robot.num_joints + 1):
        moved = chain.displacement(Moves.JOINT, joint)[:, :3]
        yield moved / np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-9)
