"""Levenberg-Marquardt for poses with noise of unknown size and with gross errors among them.

Residuals come as ``(N, m)`` for N poses, Jacobians as ``(N, m, k)``; a pose is right or wrong as a whole,
so weights are per pose. Components are divided by their noise before anything is summed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from truepath.errors import CalibrationError
from truepath.lie import Array

Evaluate = Callable[[Array], tuple[Array, Array]]

STUDENT_DOF = 4.0
MAX_ITERATIONS = 100
LIGHT_DAMPING = 1e-6
NO_CONVERGENCE = f"the fit did not converge in {MAX_ITERATIONS} evaluations of the model"
CONVERGED_CHI2 = 1e-6  # of a change in chi-square that no statistics could ever see


@dataclass(frozen=True)
class Solution:
    """Minimum of a weighted least-squares problem.

    Attributes:
        x: ``(k,)`` solution.
        residual: ``(N, m)`` in the units of the data.
        jacobian: ``(N, m, k)`` there.
        weights: ``(N,)`` weight of each pose at the solution.
        precision: of the prior that was used.
        iterations: evaluations of the model.
    """

    x: Array
    residual: Array
    jacobian: Array
    weights: Array
    precision: Array | float
    iterations: int


def minimise(
    evaluate: Evaluate,
    x: Array,
    sigma: Array,
    *,
    precision: Array | float = 0.0,
    inlier: Array | None = None,
    evaluated: tuple[Array, Array] | None = None,
    tolerance: float = CONVERGED_CHI2,
) -> Solution:
    """Minimises the chi-square of the poses that are inliers, or without that word a robust loss of all poses.

    The robust loss is Student's t with 4 degrees of freedom (Lange, Little, Taylor 1989), by reweighting.

    Args:
        evaluate: x ``(k,)`` to residual and Jacobian.
        x: ``(k,)`` start.
        sigma: ``(m,)`` noise of each component.
        precision: ``(k,)`` inverse variances of a Gaussian prior about zero.
        inlier: ``(N,)`` True for the poses that count; None for the robust loss.
        evaluated: residual and Jacobian at x, where they are known already.
        tolerance: done when the next step promises to lower half the chi-square by less.

    Raises:
        CalibrationError: no convergence after 100 evaluations, or numbers that are not finite.
    """
    residual, jacobian = evaluate(x) if evaluated is None else evaluated
    cost, weights = _loss(residual / sigma, inlier)
    cost += 0.5 * float(np.sum(precision * x**2))
    damping, iterations = LIGHT_DAMPING, int(evaluated is None)
    while iterations < MAX_ITERATIONS:
        H, gradient = _normal_equations(residual / sigma, jacobian / sigma[:, None], weights)
        H, gradient = H + np.diag(np.broadcast_to(precision, x.shape)), gradient + precision * x
        while True:
            step = -np.linalg.solve(H + damping * np.diag(np.diag(H)), gradient)
            predicted = -(gradient @ step) - 0.5 * step @ H @ step
            if predicted < tolerance and damping <= LIGHT_DAMPING:
                # So small a step needs no evaluation: the model is linear over it.
                return Solution(x + step, residual + jacobian @ step, jacobian, weights, precision, iterations)
            trial = evaluate(x + step)
            iterations += 1
            trial_cost, trial_weights = _loss(trial[0] / sigma, inlier)
            trial_cost += 0.5 * float(np.sum(precision * (x + step) ** 2))
            if not np.isfinite(trial_cost):
                raise CalibrationError("the fit ran into numbers that are not finite")
            if trial_cost <= cost or predicted < tolerance:
                break
            damping *= 10.0
            if iterations >= MAX_ITERATIONS:
                raise CalibrationError(NO_CONVERGENCE)
        if trial_cost <= cost:
            x, cost, weights = x + step, trial_cost, trial_weights
            residual, jacobian = trial
        if predicted < tolerance:
            return Solution(x, residual, jacobian, weights, precision, iterations)
        damping = max(damping / 10.0, 1e-12)
    raise CalibrationError(NO_CONVERGENCE)


def _loss(whitened: Array, inlier: Array | None) -> tuple[float, Array]:
    """Half the summed loss, and the weight of each pose that turns it into least squares."""
    distance2 = np.einsum("km,km->k", whitened, whitened)
    if inlier is not None:
        return 0.5 * float(distance2[inlier].sum()), inlier.astype(float)
    m = whitened.shape[1]
    loss = 0.5 * (STUDENT_DOF + m) * float(np.log1p(distance2 / STUDENT_DOF).sum())
    return loss, (STUDENT_DOF + m) / (STUDENT_DOF + distance2)


def _normal_equations(residual: Array, jacobian: Array, weights: Array) -> tuple[Array, Array]:
    root = np.sqrt(weights)[:, None]
    J = (jacobian * root[..., None]).reshape(-1, jacobian.shape[2])
    return J.T @ J, J.T @ (residual * root).ravel()


def covariance(solution: Solution, sigma: Array) -> Array:
    """``(k, k)`` covariance of the solution for noise ``sigma`` ``(m,)`` on each component, and its prior."""
    H, _ = _normal_equations(solution.residual / sigma, solution.jacobian / sigma[:, None], solution.weights)
    H = H + np.diag(np.broadcast_to(solution.precision, H.shape[:1]))
    scale = np.sqrt(np.diag(H))
    return np.linalg.inv(H / np.outer(scale, scale)) / np.outer(scale, scale)


def noise_components(solution: Solution, sigma: Array, groups: list[slice]) -> Array:
    """``(m,)`` noise re-estimated per group of components (variance components after Förstner 1979).

    Each group's weighted sum of squares is divided by its own redundancy: its number of readings less the
    share of the parameters that it determines.
    """
    cov, updated = covariance(solution, sigma), sigma.copy()
    used = solution.weights > 0
    for group in groups:
        J = (solution.jacobian[used, group] / sigma[group, None]).reshape(-1, len(cov))
        spent = float(np.sum((J @ cov) * J * np.repeat(solution.weights[used], 3)[:, None]))
        squares = float(np.sum(solution.weights[used, None] * solution.residual[used, group] ** 2))
        updated[group] = np.sqrt(squares / max(3.0 * used.sum() - spent, 1.0))
    return updated
