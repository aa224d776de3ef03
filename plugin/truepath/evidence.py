"""Linear regression with several noises and with parameter sizes that are learnt from the data.

Parameters come in groups; each group has a Gaussian prior about zero whose width is found by maximising the
marginal likelihood (MacKay 1992). Groups that the data has no use for shrink to nothing by themselves, so
that hundreds of waves can be offered and only the real ones are taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs

from truepath.errors import CalibrationError
from truepath.lie import Array

ROUNDING = 1e-14
MAX_ITERATIONS = 30
SETTLED = 0.05  # relative change of every size that matters
IRRELEVANT = 0.05  # of its plausible size: whatever such a group still does, it does not matter
VANISHED = 1e-3  # of its plausible size: smaller is not followed


@dataclass(frozen=True)
class LinearProblem:
    """y = A x + noise, reduced to what inference needs.

    Attributes:
        H: one ``(k, k)`` matrix A^T A per kind of reading (position, orientation).
        g: one ``(k,)`` vector A^T y per kind.
        yy: one number y^T y per kind.
        count: number of readings per kind.
    """

    H: list[Array]
    g: list[Array]
    yy: list[float]
    count: list[float]

    @classmethod
    def of(cls, A: Array, y: Array, spent: Sequence[float] = (0.0, 0.0)) -> LinearProblem:
        """From A ``(N, m, k)`` and y ``(N, m)``; m is 3 or 6, three readings of a kind.

        So many readings of each kind as ``spent`` says went into parameters that are not in A any more.
        """
        H, g, yy, count = [], [], [], []
        for first in range(0, y.shape[1], 3):
            rows, readings = A[:, first : first + 3].reshape(3 * len(A), A.shape[2]), y[:, first : first + 3].ravel()
            H.append(rows.T @ rows)
            g.append(rows.T @ readings)
            yy.append(float(readings @ readings))
            count.append(len(readings) - spent[first // 3])
        return cls(H, g, yy, count)

    def only(self, keep: Array) -> LinearProblem:
        """The same readings with the parameters for which ``keep`` ``(k,)`` is True."""
        pick = np.ix_(keep, keep)
        return LinearProblem([H[pick] for H in self.H], [g[keep] for g in self.g], self.yy, self.count)


@dataclass(frozen=True)
class Posterior:
    """What the data says.

    Attributes:
        x: ``(k,)`` mean.
        covariance: ``(k, k)``.
        sigma: noise per kind of reading.
        size: ``(groups,)`` learnt prior width of each group.
        log_evidence: logarithm of the marginal likelihood, less half the logarithm of the number of
            readings for each learnt size (Schwarz 1978), so that sizes have to earn their keep.
        readings: number of readings.
    """

    x: Array
    covariance: Array
    sigma: list[float]
    size: Array
    log_evidence: float
    readings: float

    def log_odds(self, own: Array, size: Array, num_sizes: int) -> float:
        """Log Bayes factor for some parameters against their absence (Savage, Dickey), sizes paid for.

        Args:
            own: ``(j,)`` numbers of the parameters.
            size: ``(j,)`` their prior widths.
            num_sizes: how many of these widths were learnt.
        """
        x, covariance = self.x[own] / size, self.covariance[np.ix_(own, own)] / np.outer(size, size)
        misfit = float(x @ np.linalg.solve(covariance, x))
        return 0.5 * (misfit + float(np.linalg.slogdet(covariance)[1]) - num_sizes * np.log(self.readings))


def infer(
    problem: LinearProblem,
    group: Array,
    plausible: Array,
    fixed_sigma: Array,
    sigma: list[float],
    size: Array | None = None,
) -> Posterior:
    """Finds parameters, noises and group sizes together.

    Args:
        problem: the data.
        group: ``(k,)`` group number of each parameter, -1 for those with a fixed prior.
        plausible: ``(groups,)`` plausible sizes.
        fixed_sigma: ``(k,)`` prior width of parameters without a group; it must be finite.
        sigma: noise per kind of reading to start from.
        size: ``(groups,)`` sizes to start from, if not the plausible ones.
    """
    size, sigma = (plausible if size is None else size).copy(), list(sigma)
    grouped = group >= 0
    for _ in range(MAX_ITERATIONS):
        precision = fixed_sigma**-2.0
        precision[grouped] = size[group[grouped]] ** -2.0
        x, half, log_det = _solve(problem, precision, sigma)
        known = 1.0 - precision * np.diag(half)  # how far the data, not the prior, determines each
        new_size = size.copy()
        if grouped.any():
            squares = np.bincount(group[grouped], x[grouped] ** 2, len(size))
            weight = np.bincount(group[grouped], known[grouped], len(size))
            new_size = np.sqrt(squares / np.maximum(weight, 1e-6))
        new_size = np.clip(new_size, VANISHED * plausible, 1e3 * plausible)
        new_sigma = [_noise(problem, kind, x, half, sigma[kind]) for kind in range(len(sigma))]
        matters = np.maximum(size, new_size) > IRRELEVANT * plausible
        changes = np.concatenate([new_size[matters] / size[matters], np.divide(new_sigma, sigma)])
        size, sigma = new_size, new_sigma
        if np.abs(np.log(changes)).max() < SETTLED:
            break
    precision = fixed_sigma**-2.0
    precision[grouped] = size[group[grouped]] ** -2.0
    x, half, log_det = _solve(problem, precision, sigma)
    alive = int(np.sum(size > IRRELEVANT * plausible))
    log_evidence = _log_evidence(problem, x, precision, log_det, sigma, alive)
    covariance = half + np.tril(half, -1).T
    return Posterior(x, covariance, sigma, size, log_evidence, sum(problem.count))


def _solve(problem: LinearProblem, precision: Array, sigma: list[float]) -> tuple[Array, Array, float]:
    """Mean, lower triangle of the covariance (zeros above it) and log determinant of the posterior precision.

    In scaled coordinates for stability, and in place: for hundreds of parameters, moving these matrices through
    memory costs as much as the arithmetic.
    """
    if not len(precision):
        return np.zeros(0), np.zeros((0, 0)), 0.0
    scaled, g = problem.H[0] / sigma[0] ** 2, problem.g[0] / sigma[0] ** 2
    for H, of_kind, s in zip(problem.H[1:], problem.g[1:], sigma[1:], strict=True):
        scaled += H / s**2
        g += of_kind / s**2
    scaled.flat[:: len(g) + 1] += precision
    total = np.diag(scaled).copy()
    scale = total**-0.5
    scaled *= scale[:, None]
    scaled *= scale
    factor, failed = dpotrf(scaled.T, lower=True, overwrite_a=True)  # transposed: as LAPACK has it, nothing is copied
    if failed:
        raise CalibrationError("the effects cannot be told apart numerically")
    log_det = 2.0 * float(np.sum(np.log(np.diag(factor)))) + float(np.sum(np.log(total)))
    x = scale * dpotrs(factor, scale * g, lower=True)[0]
    half = dpotri(factor, lower=True, overwrite_c=True)[0]
    half *= scale[:, None]
    half *= scale
    return x, half, log_det


def _squares(problem: LinearProblem, kind: int, x: Array) -> float:
    # A difference of numbers as large as yy is not known better than they are rounded.
    left = problem.yy[kind] - 2.0 * float(problem.g[kind] @ x) + float(x @ problem.H[kind] @ x)
    return max(left, ROUNDING * problem.yy[kind], 1e-300)


def _noise(problem: LinearProblem, kind: int, x: Array, half: Array, sigma: float) -> float:
    H = problem.H[kind]
    trace = 2.0 * float(np.vdot(half.T, H)) - float(np.diag(half) @ np.diag(H))  # of covariance and H, both symmetric
    spent = trace / sigma**2
    return float(np.sqrt(_squares(problem, kind, x) / max(problem.count[kind] - spent, 1.0)))


def _log_evidence(
    problem: LinearProblem, x: Array, precision: Array, log_det: float, sigma: list[float], sizes: int
) -> float:
    fit = sum(_squares(problem, kind, x) / s**2 for kind, s in enumerate(sigma)) + float(np.sum(precision * x**2))
    spread = sum(2.0 * n * np.log(s) for n, s in zip(problem.count, sigma, strict=True))
    constant = sum(problem.count) * np.log(2 * np.pi)
    penalty = sizes * np.log(sum(problem.count))
    return float(-0.5 * (fit + spread + constant + log_det - np.sum(np.log(precision)) + penalty))
