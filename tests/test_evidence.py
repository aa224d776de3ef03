"""Linear regression that learns noise and sizes: against answers known in closed form."""

import numpy as np
import pytest
from truepath.evidence import LinearProblem, infer


def problem(x, sigma, rows=400, seed=0):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(rows, 3, len(x)))
    return LinearProblem.of(A, A @ x + rng.normal(scale=sigma, size=(rows, 3))), A


def test_noise_and_parameters_come_out_with_their_uncertainty():
    truth = np.array([1.0, -2.0, 0.5])
    linear, _ = problem(truth, 0.1)
    posterior = infer(linear, np.array([-1, -1, -1]), np.zeros(0), np.full(3, 100.0), [1.0])
    assert posterior.sigma[0] == pytest.approx(0.1, rel=0.06)
    assert np.all(np.abs(posterior.x - truth) < 4 * np.sqrt(np.diag(posterior.covariance)))


def test_a_group_without_any_use_shrinks_to_nothing_and_a_real_one_stays():
    truth = np.concatenate([[1.0], np.zeros(20), np.full(20, 0.05)])
    linear, _ = problem(truth, 0.1)
    group = np.concatenate([[-1], np.zeros(20, int), np.ones(20, int)])
    posterior = infer(linear, group, np.array([0.1, 0.1]), np.full(41, 10.0), [1.0])
    assert posterior.size[0] < 0.01
    assert posterior.size[1] == pytest.approx(0.05, rel=0.3)
    assert posterior.log_odds(np.arange(1, 21), np.full(20, posterior.size[0]), 1) < 0
    assert posterior.log_odds(np.arange(21, 41), np.full(20, posterior.size[1]), 1) > 100


def test_the_evidence_is_the_marginal_likelihood():
    """Against the density of the readings, a Gaussian with covariance A P A^T + sigma^2, written out."""
    rng = np.random.default_rng(1)
    A, prior = rng.normal(size=(20, 3, 4)), np.array([1.0, 2.0, 0.5, 1.5])
    y = A @ (prior * rng.normal(size=4)) + rng.normal(scale=0.3, size=(20, 3))
    posterior = infer(LinearProblem.of(A, y), np.full(4, -1), np.zeros(0), prior, [0.3])
    flat, sigma = A.reshape(-1, 4), posterior.sigma[0]
    covariance = flat @ np.diag(prior**2) @ flat.T + sigma**2 * np.eye(60)
    expected = -0.5 * (
        y.ravel() @ np.linalg.solve(covariance, y.ravel()) + np.linalg.slogdet(covariance)[1] + 60 * np.log(2 * np.pi)
    )
    assert posterior.log_evidence == pytest.approx(expected, abs=1e-6)


def test_position_and_orientation_have_noises_of_their_own():
    rng = np.random.default_rng(2)
    A = rng.normal(size=(500, 6, 2))
    noise = rng.normal(size=(500, 6)) * np.repeat([0.1, 0.01], 3)
    posterior = infer(
        LinearProblem.of(A, A @ np.array([1.0, 2.0]) + noise), np.full(2, -1), np.zeros(0), np.full(2, 10.0), [1.0, 1.0]
    )
    assert posterior.sigma == pytest.approx([0.1, 0.01], rel=0.06)


def test_leaving_parameters_out_is_the_same_as_never_having_had_them():
    linear, A = problem(np.array([1.0, -2.0, 0.5]), 0.1)
    rng = np.random.default_rng(0)
    rng.normal(size=A.shape)
    keep = np.array([True, False, True])
    readings = A @ np.array([1.0, -2.0, 0.5]) + rng.normal(scale=0.1, size=A.shape[:2])
    fewer = LinearProblem.of(A[:, :, keep], readings)
    assert np.allclose(linear.only(keep).H[0], fewer.H[0])
    assert np.allclose(linear.only(keep).g[0], fewer.g[0])
