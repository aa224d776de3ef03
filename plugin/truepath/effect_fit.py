"""Fitting terms of named effects on top of the kinematics, all kinematic parameters staying free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath import poe
from truepath.context import Context
from truepath.effects.base import FittedTerm, Term
from truepath.evidence import LinearProblem, infer
from truepath.lie import Array
from truepath.motions import ChainPoses
from truepath.poe_symbolic import PoseProblem
from truepath.robust_fit import NOISE_FLOOR, RobustFit, inliers
from truepath.term_set import TermSet

MAX_ROUNDS = 8
SETTLED = 0.05  # of the noise: the largest change of any prediction that is not worth another round
NEIGHBOURHOOD = 9  # rows
FRAME_PRIOR = 1.0  # m and rad: no prior at all, but finite


@dataclass(frozen=True)
class EffectFit:
    """Kinematics and effects, fitted together.

    Attributes:
        p: ``(4 n + 12,)`` kinematic parameters.
        covariance: of the free ones.
        effects: what was found; terms and groups that the data does not speak for are left out.
        sigma: ``(m,)`` noise of each component.
        inlier: ``(N,)``.
        residual: ``(N, m)``.
        prior_size: ``(K,)`` learnt prior width of each parameter of the effects.
        log_odds: of each effect, by name: the model with it against the one without.
        log_evidence: of the inliers.
    """

    p: Array
    covariance: Array
    effects: tuple[FittedTerm, ...]
    sigma: Array
    inlier: Array
    residual: Array
    prior_size: Array
    log_odds: dict[str, float]
    log_evidence: float

    @property
    def terms(self) -> tuple[Term, ...]:
        return tuple(part.term for part in self.effects)

    @property
    def values(self) -> Array:
        """``(K,)`` of all terms in a row."""
        return np.concatenate([part.values for part in self.effects]) if self.effects else np.zeros(0)


@dataclass(frozen=True)
class Linearised:
    """The readings near a model: y = J_kinematics (p' - p) + A values' + noise.

    Attributes:
        y: ``(N, m)`` measured less predicted, the effects' own share added again.
        kinematics: ``(N, m, k)`` derivative by the free kinematic parameters.
        effects: ``(N, m, K)`` derivative by the parameters of the effects.
        chain: where everything is, for the columns of other effects.
    """

    y: Array
    kinematics: Array
    effects: Array
    chain: ChainPoses


def linearise(
    problem: PoseProblem, free: Array, context: Context, terms: TermSet, p: Array, values: Array
) -> Linearised:
    """The model with deviations p and effects of those values, and its derivatives."""
    robot, n = problem.robot, problem.robot.num_joints
    error = terms.joint_error(values, len(context), n)
    residual, by_p = problem.evaluate(p, error)
    X_MB = problem.X_MB @ poe.frame_step(p[poe.base_slice(n)])
    X_FE = problem.X_FE @ poe.frame_step(p[poe.tool_slice(n)])
    chain = ChainPoses.of(robot, p, context.q_rad + error, X_MB, X_FE)
    A = terms.columns(chain, problem.components)
    # What does not enter through the joints is not in the residual yet; effects are solved for as they are.
    elsewhere = terms.moves_no_joint()
    residual = residual + A[:, :, elsewhere] @ values[elsewhere]
    return Linearised(A @ values - residual, by_p[:, :, free], A, chain)


def kinematic_prior(kinematic: RobustFit) -> Array:
    """``(k,)`` finite prior widths of the free kinematic parameters."""
    return np.minimum(kinematic.prior_sigma[kinematic.free], FRAME_PRIOR)


def fit_effects(
    kinematic: RobustFit,
    context: Context,
    terms: Sequence[Term],
    *,
    prune: bool = True,
    start: EffectFit | None = None,
    together: bool = False,
) -> EffectFit:
    """Continues a kinematic fit with terms of effects; with none, only adds the evidence.

    Args:
        kinematic: the fit to go on from.
        context: of all its poses.
        terms: what to fit.
        prune: drop groups and terms that the data does not speak for.
        start: a fit with about the same terms, to go on from.
        together: let rows that were left out together take part again, to see what they can be told by.
    """
    offered = TermSet.of(kinematic.problem.robot, context, terms)
    prior = kinematic_prior(kinematic)
    k = len(prior)
    if start is None:
        inlier, sigma = kinematic.solution.weights > 0, kinematic.sigma
        if together:
            inlier = single_rows_apart(inlier)
        p, values, size = kinematic.p.copy(), np.zeros(len(offered)), offered.plausible
    else:
        inlier, sigma, p = start.inlier, start.sigma, start.p.copy()
        values, size = _carried_over(start, offered)
    for _ in range(MAX_ROUNDS):
        near = linearise(kinematic.problem, kinematic.free, context, offered, p, values)
        A = np.concatenate([near.kinematics, near.effects], axis=2)
        problem = LinearProblem.of(A[inlier], near.y[inlier])
        kept = np.arange(len(offered))
        while True:
            group = np.concatenate([np.full(k, -1), offered.group])
            fixed = np.concatenate([prior, np.ones(len(offered))])
            posterior = infer(problem, group, offered.plausible, fixed, list(sigma[::3]), size)
            size = posterior.size
            speaks = offered.possible(posterior.x[k:])
            if prune:
                speaks &= offered.spoken_for(posterior, k)
            if speaks.all():
                break
            offered, size = offered.only(speaks), size[np.unique(offered.group[speaks])]
            kept = kept[speaks]
            problem = problem.only(np.concatenate([np.ones(k, bool), speaks]))
        solution = np.zeros(A.shape[2])
        solution[:k], solution[k + kept] = posterior.x[:k], posterior.x[k:]
        residual = A @ solution - near.y
        solution[k:] -= values
        moved = A @ solution
        p[kinematic.free] += posterior.x[:k]
        values = posterior.x[k:]
        sigma = np.repeat(np.maximum(posterior.sigma, NOISE_FLOOR), 3)
        before, inlier = inlier, inliers(residual, sigma)
        if (len(solution) == k or np.abs(moved / sigma).max() < SETTLED) and np.array_equal(before, inlier):
            break
    return EffectFit(
        p=p,
        covariance=posterior.covariance[:k, :k],
        effects=offered.fitted(values, np.sqrt(np.diag(posterior.covariance)[k:])),
        sigma=sigma,
        inlier=inlier,
        residual=residual,
        prior_size=posterior.size[offered.group],
        log_odds={name: offered.log_odds(offered.of_effect(name), posterior, k) for name in offered.effects},
        log_evidence=posterior.log_evidence,
    )


def _carried_over(start: EffectFit, offered: TermSet) -> tuple[Array, Array]:
    """Values ``(K,)`` and sizes ``(groups,)`` of what an earlier fit has too; 0 and plausible for the rest."""
    known = {}
    for part in start.effects:
        term = part.term
        for parameter, value in zip(term.parameters, part.values, strict=True):
            known[term.effect, term.moves, term.joint, term.constants, parameter.name] = value
    sizes = dict(zip(known, start.prior_size, strict=True))
    values, size = np.zeros(len(offered)), offered.plausible.copy()
    names = ((t, p.name) for t in offered.terms for p in t.parameters)
    for i, (term, name) in enumerate(names):
        place = (term.effect, term.moves, term.joint, term.constants, name)
        if place in known:
            values[i] = known[place]
            size[offered.group[i]] = sizes[place]
    return values, size


def single_rows_apart(inlier: Array) -> Array:
    """``(N,)`` where only rows that stand alone stay left out.

    A beam is broken for a row or two. Where most rows of a stretch do not fit, something has moved, and they are
    what it can be told by.
    """
    around = np.convolve(~inlier, np.ones(NEIGHBOURHOOD), mode="same")
    room = np.convolve(np.ones(len(inlier)), np.ones(NEIGHBOURHOOD), mode="same")
    return inlier | (around > 0.5 * room)
