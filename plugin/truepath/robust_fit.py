"""The kinematic fit: robust first, then least squares on the poses that are no outliers."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from truepath.levenberg_marquardt import CONVERGED_CHI2, Solution, minimise, noise_components
from truepath.lie import Array
from truepath.poe_symbolic import PoseProblem

ROBUST_ROUNDS, MAX_ROUNDS = 20, 30
NEAR_ENOUGH = 0.1  # of half the chi-square
OUTLIER_PROBABILITY = 1e-3  # of calling any row of a clean data set an outlier
OUTLIER_MARGIN = 1.5  # what is left of an imperfect model has longer tails than noise
NOISE_FLOOR = 1e-10  # m and rad; keeps data without noise solvable


class RobustFit:
    """Robust fit, rejection of outliers, least squares; the noise is estimated all along.

    Args:
        problem: residuals and derivatives.
        free: ``(k,)`` True for parameters to estimate.
        prior_sigma: ``(k,)`` width of each parameter's prior about nominal.

    Attributes:
        p: ``(k,)`` parameters.
        sigma: ``(m,)`` noise of each component.
        solution: of the last step, in terms of the free parameters.
        iterations: evaluations of the model.
    """

    def __init__(self, problem: PoseProblem, free: Array, prior_sigma: Array) -> None:
        self.problem, self.free, self.prior_sigma = problem, free.copy(), prior_sigma
        self.groups = [slice(k, k + 3) for k in range(0, problem.components, 3)]
        self.p, self.iterations = np.zeros(len(free)), 0
        residual = problem.evaluate(self.p)[0]
        self.sigma = np.concatenate([np.full(3, _median_noise(residual[:, group])) for group in self.groups])
        self._known: tuple[Array, Array] | None = None
        self.solution: Solution

    def run(self) -> None:
        """Fits."""
        for _ in range(ROBUST_ROUNDS):
            # Gross errors must not widen the noise that they are judged by: it comes from the median here.
            before = self.sigma
            self._step(None, tolerance=NEAR_ENOUGH)
            spent = len(self.solution.x) / len(self.groups) / 3 / len(self.solution.residual)
            medians = [_median_noise(self.solution.residual[:, group]) for group in self.groups]
            self.sigma = np.repeat(medians, 3) / np.sqrt(max(1.0 - spent, 0.1))
            if np.allclose(self.sigma, before, rtol=0.05):
                break
        inlier = inliers(self.solution.residual, self.sigma)
        for _ in range(MAX_ROUNDS):
            before, sigma_before = inlier, self.sigma
            self._step(inlier)
            inlier = inliers(self.solution.residual, self.sigma)
            # Only the ratio of position to orientation noise moves the solution.
            balanced = np.allclose(self.sigma / self.sigma[0], sigma_before / sigma_before[0], rtol=1e-3)
            if balanced and np.array_equal(inlier, before):
                break

    def _step(self, inlier: Array | None, tolerance: float = CONVERGED_CHI2) -> None:
        self.solution = minimise(
            self._evaluate,
            self.p[self.free],
            self.sigma,
            precision=self.prior_sigma[self.free] ** -2.0,
            inlier=inlier,
            evaluated=self._known,
            tolerance=tolerance,
        )
        self.p[self.free] = self.solution.x
        self._known = (self.solution.residual, self.solution.jacobian)
        self.iterations += self.solution.iterations
        self.sigma = np.maximum(noise_components(self.solution, self.sigma, self.groups), NOISE_FLOOR)

    def _evaluate(self, x: Array) -> tuple[Array, Array]:
        p = self.p.copy()
        p[self.free] = x
        residual, J = self.problem.evaluate(p)
        return residual, J[:, :, self.free]


def _median_noise(residual: Array) -> float:
    """Noise per axis from the median length of residuals ``(N, 3)``; 1.538 is the median of a chi with 3 dof."""
    return max(float(np.median(np.linalg.norm(residual, axis=1))) / 1.538, NOISE_FLOOR)


def inliers(residual: Array, sigma: Array) -> Array:
    """``(N,)`` False where a residual ``(N, m)`` is larger than noise ``(m,)`` ever makes one."""
    N, m = residual.shape
    limit = chdtri(m, OUTLIER_PROBABILITY / N) * OUTLIER_MARGIN**2
    return np.sum((residual / sigma) ** 2, axis=1) <= limit
