"""Fitting named effects on top of the kinematics, all kinematic parameters staying free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath.effects import term_bases, terms_of
from truepath.effects.base import FittedTerm, Term
from truepath.evidence import IRRELEVANT, LinearProblem, Posterior, infer
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.robot import NominalRobot
from truepath.robust_fit import NOISE_FLOOR, RobustFit, inliers

MAX_ROUNDS = 8
SETTLED = 0.05  # of the noise: the largest change of any prediction that is not worth another round
FRAME_PRIOR = 1.0  # m and rad: no prior at all, but finite


@dataclass(frozen=True)
class EffectFit:
    """Kinematics and effects, fitted together.

    Attributes:
        p: ``(4 n + 12,)`` kinematic parameters.
        covariance: of the free ones.
        effects: what was found; terms and waves that the data has no use for are left out.
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
    payload = 0.0 if measurements.payload_kg is None else measurements.payload_kg
    inlier, sigma = kinematic.solution.weights > 0, kinematic.sigma
    terms = terms_of(names, robot, measurements.q_rad[inlier])
    bases = term_bases(robot, measurements.q_rad, terms, payload)
    layout = _Layout.of(terms, kinematic)
    p, values = kinematic.p.copy(), np.zeros(layout.num_effects)
    residual, size = kinematic.solution.residual, layout.plausible
    for _ in range(MAX_ROUNDS):
        joint_error = _joint_error(measurements.q_rad.shape, terms, bases, values)
        residual, by_p, by_angle = kinematic.problem.evaluate_with_angles(p, joint_error)
        by_effect = [
            by_angle[:, :, term.joint - 1, None] * base[:, None, :] for term, base in zip(terms, bases, strict=True)
        ]
        A = np.concatenate([by_p[:, :, kinematic.free], *by_effect], axis=2)
        # Effects are solved for as they are, kinematics as a step from where it stands.
        y = -residual + A[:, :, layout.num_kinematic :] @ values
        posterior = infer(
            LinearProblem.of(A[inlier], y[inlier]),
            layout.group,
            layout.plausible,
            layout.fixed_sigma,
            list(sigma[::3]),
            size,
        )
        size = posterior.size
        step = posterior.x.copy()
        step[layout.num_kinematic :] -= values
        p[kinematic.free] += posterior.x[: layout.num_kinematic]
        values = posterior.x[layout.num_kinematic :]
        sigma = np.repeat(np.maximum(posterior.sigma, NOISE_FLOOR), 3)
        residual = residual + A @ step
        before, inlier = inlier, inliers(residual, sigma)
        moved = np.abs(A @ step / sigma).max()
        if (moved < SETTLED or not terms) and np.array_equal(before, inlier):
            break
    k = layout.num_kinematic
    return EffectFit(
        p=p,
        covariance=posterior.covariance[:k, :k],
        effects=_found(terms, layout, posterior),
        sigma=sigma,
        inlier=inlier,
        residual=residual,
        log_evidence=posterior.log_evidence,
    )


@dataclass(frozen=True)
class _Layout:
    """Which column is what: kinematic parameters first, then the parameters of all terms one after the other."""

    num_kinematic: int
    num_effects: int
    group: Array
    plausible: Array
    fixed_sigma: Array

    @classmethod
    def of(cls, terms: Sequence[Term], kinematic: RobustFit) -> _Layout:
        kinematic_prior = np.minimum(kinematic.prior_sigma[kinematic.free], FRAME_PRIOR)
        numbers: dict[tuple[str, int, str], int] = {}
        group, plausible = [], {}
        for term in terms:
            for parameter in term.parameters:
                number = numbers.setdefault((term.effect, term.joint, parameter.group), len(numbers))
                plausible[number] = parameter.prior_scale
                group.append(number)
        k = len(kinematic_prior)
        return cls(
            num_kinematic=k,
            num_effects=len(group),
            group=np.concatenate([np.full(k, -1), np.array(group, int)]),
            plausible=np.array([plausible[number] for number in range(len(numbers))], float),
            fixed_sigma=np.concatenate([kinematic_prior, np.ones(len(group))]),
        )


def _joint_error(shape: tuple[int, ...], terms: Sequence[Term], bases: list[Array], values: Array) -> Array:
    error, first = np.zeros(shape), 0
    for term, base in zip(terms, bases, strict=True):
        error[:, term.joint - 1] += base @ values[first : first + base.shape[1]]
        first += base.shape[1]
    return error


def _found(terms: Sequence[Term], layout: _Layout, posterior: Posterior) -> tuple[FittedTerm, ...]:
    """The terms with the groups of parameters that have not shrunk to nothing."""
    sigma, found, first = np.sqrt(np.diag(posterior.covariance)), [], layout.num_kinematic
    for term in terms:
        own = np.arange(first, first + len(term.parameters))
        first += len(own)
        group = layout.group[own]
        keep = posterior.size[group] > IRRELEVANT * layout.plausible[group]
        if keep.any():
            kept = tuple(parameter for parameter, k in zip(term.parameters, keep, strict=True) if k)
            small = Term(term.effect, term.joint, term.lower_rad, term.upper_rad, kept)
            found.append(FittedTerm(small, posterior.x[own[keep]], sigma[own[keep]]))
    return tuple(found)
