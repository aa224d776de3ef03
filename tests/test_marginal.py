"""The kinematics taken out of the readings: against the textbook's integral over its parameters, written out."""

import numpy as np
import pytest
from truepath.evidence import infer
from truepath.marginal import Marginal

POSES, SIGMA = 40, np.repeat([3e-2, 5e-3], 3)


class Readings:
    """y = J p + A x + noise of two kinds; J moves a lot, A a little. ``wide`` is the prior of p."""

    def __init__(self, wide, seed=0):
        rng = np.random.default_rng(seed)
        self.J, self.A = rng.normal(size=(POSES, 6, 9)), rng.normal(size=(POSES, 6, 4))
        self.x, self.prior = np.array([0.5, 0.0, -1.0, 2.0]), np.full(9, wide)
        p = rng.normal(size=9)
        self.y = self.J @ p + self.A @ self.x + rng.normal(size=(POSES, 6)) * SIGMA
        self.marginal = Marginal.of(self.y, self.J, self.prior, SIGMA)

    def covariance_of_readings(self):
        """Of y once p is integrated out: noise plus J P J^T."""
        J = self.J.reshape(-1, 9)
        return np.diag(np.tile(SIGMA, POSES) ** 2) + J @ np.diag(self.prior**2) @ J.T

    def textbook_posterior(self, width):
        """Mean and covariance of x ``(4,)`` with a prior of that width, p integrated out."""
        A, S = self.A.reshape(-1, 4), self.covariance_of_readings()
        covariance = np.linalg.inv(A.T @ np.linalg.solve(S, A) + np.eye(4) / width**2)
        return covariance @ A.T @ np.linalg.solve(S, self.y.ravel()), covariance

    def posterior(self, width):
        problem = self.marginal.problem(self.marginal.project(self.A))
        H = sum(problem.H) + np.eye(4) / width**2
        return np.linalg.solve(H, sum(problem.g)), np.linalg.inv(H)


@pytest.fixture(scope="module")
def readings():
    return Readings(wide=30.0)  # a thousand times what the readings leave open


def test_what_is_left_says_of_an_effect_what_integration_over_the_kinematics_says(readings):
    mean, covariance = readings.posterior(1.0)
    expected_mean, expected_covariance = readings.textbook_posterior(1.0)
    np.testing.assert_allclose(mean, expected_mean, atol=1e-6)
    np.testing.assert_allclose(covariance, expected_covariance, rtol=1e-5, atol=1e-10)


def test_the_evidence_for_an_effect_is_the_ratio_of_the_densities_of_the_readings(readings):
    """Two Gaussian densities of all readings, p integrated out: with x of width 1 in them, and without."""
    S, A = readings.covariance_of_readings(), readings.A.reshape(-1, 4)

    def log_density(C):
        y = readings.y.ravel()
        return -0.5 * (y @ np.linalg.solve(C, y) + np.linalg.slogdet(C)[1])

    expected = log_density(S + A @ A.T) - log_density(S)
    problem = readings.marginal.problem(readings.marginal.project(readings.A))
    H, g = sum(problem.H) + np.eye(4), sum(problem.g)
    found = 0.5 * (g @ np.linalg.solve(H, g) - np.linalg.slogdet(H)[1])
    assert found == pytest.approx(expected, rel=1e-5)


def test_where_the_prior_knows_something_an_effect_is_never_made_out_surer_than_it_is():
    readings = Readings(wide=0.02)
    found, expected = (np.diag(each(1.0)[1]) for each in (readings.posterior, readings.textbook_posterior))
    assert (found >= expected * (1 - 1e-9)).all()


def test_nothing_is_left_of_what_the_kinematics_can_imitate(readings):
    imitable = readings.J @ np.random.default_rng(1).normal(size=(9, 3))
    whole = np.linalg.norm(imitable / SIGMA[:, None])
    assert np.linalg.norm(readings.marginal.project(imitable)) < 1e-8 * whole


def test_what_is_left_is_at_right_angles_to_the_kinematics(readings):
    left = readings.marginal.project(readings.A).reshape(-1, 4)
    J = (readings.J / SIGMA[:, None]).reshape(-1, 9)
    assert np.abs(J.T @ left).max() < 1e-6 * np.linalg.norm(J) * np.linalg.norm(left)


def test_taking_out_twice_is_taking_out_once(readings):
    once = readings.marginal.project(readings.A)
    np.testing.assert_allclose(readings.marginal.project(once * SIGMA[:, None]), once, atol=1e-6)


@pytest.mark.parametrize("components", [3, 6])
def test_noise_alone_is_left_with_variance_one_when_what_was_spent_is_counted(components):
    """Kind by kind: the more precise readings pay for more of the parameters."""
    found, sigma = [], SIGMA[:components]
    for seed in range(20):
        rng = np.random.default_rng(seed)
        J = rng.normal(size=(POSES, components, 30))
        y = J @ rng.normal(size=30) + rng.normal(size=(POSES, components)) * sigma
        problem = Marginal.of(y, J, np.full(30, 1e3), sigma).problem(np.zeros((POSES, components, 0)))
        assert sum(problem.count) == pytest.approx(components * POSES - 30)
        posterior = infer(problem, np.zeros(0, int), np.zeros(0), np.zeros(0), [1.0] * (components // 3))
        found.append(posterior.sigma)
    assert np.mean(found, axis=0) == pytest.approx(1.0, rel=0.03)


def test_with_fewer_parameters_taken_out_the_same_readings_are_looked_at(readings):
    fewer = readings.marginal.first(4)
    np.testing.assert_array_equal(fewer.y, readings.marginal.y)
    J = readings.J[:, :, :4] @ np.ones((4, 1))
    assert np.linalg.norm(fewer.project(J)) < 1e-8 * np.linalg.norm(J / SIGMA[:, None])
    kept = readings.J[:, :, 8:]
    assert np.linalg.norm(fewer.project(kept)) > 0.8 * np.linalg.norm(kept / SIGMA[:, None])
