"""Fitting named effects on top of the kinematics, all kinematic parameters staying free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath.effects import term_bases, terms_of
from truepath.effects.base import FittedTerm, Term
from truepath.evidence import LinearProblem, Posterior, infer
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.robot import NominalRobot
from truepath.robust_fit import NOISE_FLOOR, RobustFit, inliers

MAX_ROUNDS = 8
SETTLED = 0.05  # of the noise: the largest change of any prediction that is not worth another round
FRAME_PRIOR = 1.0  # m and rad: no prior at all, but finite
LEAST_LOG_ODDS_GROUP = 5.0  # for a band of waves or the like to stay
LEAST_LOG_ODDS_TERM = 10.0  # for a joint to be named


@dataclass(frozen=True)
class EffectFit:
    """Kinematics and effects, fitted together.

    Attributes:
        p: ``(4 n + 12,)`` kinematic parameters.
        covariance: of the free ones.
        effects: what was found; joints and waves that the data does not speak for are left out.
        sigma: ``(m,)`` noise of each component.
        inlier: ``(N,)``.
        residual: ``(N, m)``.
        log_evidence: of the inliers.
    """

    p: Array
    covariance: Array
    effects: tuple[FittedTerm, ...]
    sigma: Array
    inlier: Array
    residual: Array
    log_evidence: float


def fit_effects(
    kinematic: RobustFit, robot: NominalRobot, measurements: Measurements, names: Sequence[str]
) -> EffectFit:
    """Continues a kinematic fit with named effects; with none, only adds the evidence."""
    inlier, sigma = kinematic.solution.weights > 0, kinematic.sigma
    offered = terms_of(names, robot, measurements.q_rad[inlier])
    waves = _Waves.of(offered, term_bases(robot, measurements.q_rad, offered, measurements.extra_payload_kg))
    kinematic_prior = np.minimum(kinematic.prior_sigma[kinematic.free], FRAME_PRIOR)
    k = len(kinematic_prior)
    p, values, size = kinematic.p.copy(), np.zeros(len(waves)), waves.plausible
    for _ in range(MAX_ROUNDS):
        residual, by_p, by_angle = kinematic.problem.evaluate_with_angles(
            p, waves.joint_error(values, robot.num_joints)
        )
        A = np.concatenate([by_p[:, :, kinematic.free], waves.columns(by_angle)], axis=2)
        # Effects are solved for as they are, kinematics as a step from where it stands.
        y = -residual + A[:, :, k:] @ values
        problem, kept = LinearProblem.of(A[inlier], y[inlier]), np.arange(len(waves))
        while True:
            group = np.concatenate([np.full(k, -1), waves.group])
            fixed = np.concatenate([kinematic_prior, np.ones(len(waves))])
            posterior = infer(problem, group, waves.plausible, fixed, list(sigma[::3]), size)
            size = posterior.size
            speaks = waves.spoken_for(posterior, k)
            if speaks.all():
                break
            waves, size = waves.only(speaks), size[np.unique(waves.group[speaks])]
            kept = kept[speaks]
            problem = problem.only(np.concatenate([np.ones(k, bool), speaks]))
        step = np.concatenate([posterior.x[:k], -values])
        step[k + kept] += posterior.x[k:]
        p[kinematic.free] += posterior.x[:k]
        values = posterior.x[k:]
        sigma = np.repeat(np.maximum(posterior.sigma, NOISE_FLOOR), 3)
        moved = A @ step
        residual = residual + moved
        before, inlier = inlier, inliers(residual, sigma)
        if (len(step) == k or np.abs(moved / sigma).max() < SETTLED) and np.array_equal(before, inlier):
            break
    return EffectFit(
        p=p,
        covariance=posterior.covariance[:k, :k],
        effects=waves.fitted(values, np.sqrt(np.diag(posterior.covariance)[k:])),
        sigma=sigma,
        inlier=inlier,
        residual=residual,
        log_evidence=posterior.log_evidence,
    )


@dataclass(frozen=True)
class _Waves:
    """All parameters of all terms in a row, whether waves or anything else.

    Attributes:
        terms: the terms, each with those of its parameters that are still there.
        term: ``(k,)`` number of the term of each parameter.
        group: ``(k,)`` number of the group of each.
        plausible: ``(groups,)`` plausible size of each group.
        basis: ``(N, k)`` error in rad of the term's joint per unit.
    """

    terms: tuple[Term, ...]
    term: Array
    group: Array
    plausible: Array
    basis: Array

    @classmethod
    def of(cls, terms: Sequence[Term], bases: Sequence[Array]) -> _Waves:
        labels = [(t, parameter.group) for t, term in enumerate(terms) for parameter in term.parameters]
        numbers = {label: number for number, label in enumerate(dict.fromkeys(labels))}
        plausible = {
            numbers[t, parameter.group]: parameter.prior_scale
            for t, term in enumerate(terms)
            for parameter in term.parameters
        }
        return cls(
            tuple(terms),
            np.array([t for t, _ in labels], int),
            np.array([numbers[label] for label in labels], int),
            np.array([plausible[number] for number in range(len(numbers))], float),
            np.concatenate(bases, axis=1) if bases else np.zeros((0, 0)),
        )

    def __len__(self) -> int:
        return len(self.group)

    def joint_error(self, values: Array, num_joints: int) -> Array:
        """``(N, n)`` rad; a plain zero without any term."""
        error = np.zeros((len(self.basis), num_joints)) if len(self) else np.zeros((1, num_joints))
        for t, term in enumerate(self.terms):
            own = self.term == t
            error[:, term.joint - 1] += self.basis[:, own] @ values[own]
        return error

    def columns(self, by_angle: Array) -> Array:
        """``(N, m, k)`` derivative of the residual, from that by the joint angles ``(N, m, n)``."""
        if not len(self):
            return np.zeros((*by_angle.shape[:2], 0))
        joint = np.array([term.joint - 1 for term in self.terms])[self.term]
        return by_angle[:, :, joint] * self.basis[:, None, :]

    def spoken_for(self, posterior: Posterior, first: int) -> Array:
        """``(k,)`` False for the parameters that are the next to go, because the data does not speak for them.

        Groups of one term can stand in for each other, so only the weakest of each term goes at a time; when
        no group has to go any more, the weakest term.
        """
        keep = np.ones(len(self), bool)
        for t in range(len(self.terms)):
            groups = np.unique(self.group[self.term == t])
            odds = [self._log_odds(self.group == group, posterior, first) for group in groups]
            if min(odds) < LEAST_LOG_ODDS_GROUP:
                keep[self.group == groups[int(np.argmin(odds))]] = False
        if keep.all() and self.terms:
            odds = [self._log_odds(self.term == t, posterior, first) for t in range(len(self.terms))]
            if min(odds) < LEAST_LOG_ODDS_TERM:
                keep[self.term == int(np.argmin(odds))] = False
        return keep

    def _log_odds(self, own: Array, posterior: Posterior, first: int) -> float:
        groups = self.group[own]
        return posterior.log_odds(first + np.flatnonzero(own), posterior.size[groups], len(np.unique(groups)))

    def only(self, keep: Array) -> _Waves:
        """Without the parameters for which ``keep`` ``(k,)`` is False."""
        terms = []
        for t, term in enumerate(self.terms):
            parameters = tuple(p for p, k in zip(term.parameters, keep[self.term == t], strict=True) if k)
            if parameters:
                terms.append(Term(term.effect, term.joint, term.lower_rad, term.upper_rad, parameters))
        groups, group = np.unique(self.group[keep], return_inverse=True)
        term_of = np.unique(self.term[keep], return_inverse=True)[1]
        return _Waves(tuple(terms), term_of, group, self.plausible[groups], self.basis[:, keep])

    def fitted(self, values: Array, sigma: Array) -> tuple[FittedTerm, ...]:
        return tuple(
            FittedTerm(term, values[self.term == t], sigma[self.term == t]) for t, term in enumerate(self.terms)
        )
