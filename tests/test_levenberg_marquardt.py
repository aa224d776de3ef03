"""Levenberg-Marquardt against problems whose answer is known by other means."""

import numpy as np
import pytest
from truepath.errors import CalibrationError
from truepath.levenberg_marquardt import covariance, minimise, noise_components

N, M = 60, 3
SIGMA = np.array([0.1, 0.1, 0.1])


def linear(A, b):
    return lambda x: (A @ x - b, A)


@pytest.fixture
def line_fit():
    """A linear problem ``(A, b)`` with the noise SIGMA; the truth is (1, -2)."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(N, M, 2))
    return A, A @ [1.0, -2.0] + rng.normal(scale=0.1, size=(N, M))


def decay(t, y):
    """Fit of y = a exp(-b t), one component."""

    def evaluate(x):
        e = np.exp(-x[1] * t)
        return (x[0] * e - y)[:, None], np.stack([e, -x[0] * t * e], axis=1)[:, None, :]

    return evaluate


def test_a_linear_problem_has_the_solution_of_linear_least_squares(line_fit):
    A, b = line_fit
    solution = minimise(linear(A, b), np.zeros(2), SIGMA, inlier=np.ones(N, bool))
    assert solution.x == pytest.approx(np.linalg.lstsq(A.reshape(-1, 2), b.ravel(), rcond=None)[0], abs=1e-9)
    assert np.allclose(solution.residual, A @ solution.x - b)


def test_components_count_by_the_inverse_of_their_variance(line_fit):
    A, b = line_fit
    sigma = np.array([1e-3, 1.0, 1.0])
    solution = minimise(linear(A, b), np.zeros(2), sigma, inlier=np.ones(N, bool))
    rows = np.linalg.lstsq((A / sigma[:, None]).reshape(-1, 2), (b / sigma).ravel(), rcond=None)[0]
    assert solution.x == pytest.approx(rows, abs=1e-9)


def test_a_nonlinear_problem_is_solved_from_a_start_that_is_far_away():
    t = np.linspace(0, 4, N)
    solution = minimise(decay(t, 3 * np.exp(-0.7 * t)), np.array([1.0, 1.5]), np.full(1, 1e-3), inlier=np.ones(N, bool))
    assert solution.x == pytest.approx([3.0, 0.7], abs=1e-6)


def test_the_valley_of_rosenbrock_is_followed_to_its_end():
    def evaluate(x):
        residual = np.array([[10 * (x[1] - x[0] ** 2), 1 - x[0]]])
        return residual, np.array([[[-20 * x[0], 10.0], [-1.0, 0.0]]])

    solution = minimise(evaluate, np.array([-1.2, 1.0]), np.full(2, 1e-6), inlier=np.ones(1, bool))
    assert solution.x == pytest.approx([1.0, 1.0], abs=1e-9)


def test_rows_that_are_no_inliers_have_no_say(line_fit):
    A, b = line_fit
    inlier = np.arange(N) >= 10
    expected = minimise(linear(A[inlier], b[inlier]), np.zeros(2), SIGMA, inlier=np.ones(N - 10, bool)).x
    b = b.copy()
    b[~inlier] += 1e6
    solution = minimise(linear(A, b), np.zeros(2), SIGMA, inlier=inlier)
    assert solution.x == pytest.approx(expected, abs=1e-9)
    assert np.array_equal(solution.weights, inlier)


def test_the_robust_loss_hardly_feels_gross_errors_and_gives_them_little_weight(line_fit):
    A, b = line_fit
    clean = minimise(linear(A, b), np.zeros(2), SIGMA).x
    b = b.copy()
    b[:12] += 50.0
    solution = minimise(linear(A, b), np.zeros(2), SIGMA)
    assert np.abs(solution.x - clean).max() < 0.05
    assert solution.weights[:12].max() < 1e-3 * np.median(solution.weights[12:])


def test_where_all_rows_are_clean_the_robust_loss_agrees_with_least_squares(line_fit):
    A, b = line_fit
    robust = minimise(linear(A, b), np.zeros(2), SIGMA).x
    plain = minimise(linear(A, b), np.zeros(2), SIGMA, inlier=np.ones(N, bool)).x
    assert np.abs(robust - plain).max() < 0.01  # the standard deviation of either is 0.0075


def test_a_prior_acts_like_a_reading_of_zero(line_fit):
    A, b = line_fit
    precision = np.array([400.0, 0.0])
    solution = minimise(linear(A, b), np.zeros(2), SIGMA, precision=precision, inlier=np.ones(N, bool))
    rows = np.concatenate([(A / 0.1).reshape(-1, 2), [[20.0, 0.0]]])
    expected = np.linalg.lstsq(rows, np.append((b / 0.1).ravel(), 0.0), rcond=None)[0]
    assert solution.x == pytest.approx(expected, abs=1e-8)
    assert covariance(solution, SIGMA) == pytest.approx(np.linalg.inv(rows.T @ rows), rel=1e-9)


def test_a_start_that_was_evaluated_already_is_not_evaluated_again(line_fit):
    A, b = line_fit
    calls = []

    def evaluate(x):
        calls.append(x)
        return linear(A, b)(x)

    known = linear(A, b)(np.zeros(2))
    solution = minimise(evaluate, np.zeros(2), SIGMA, inlier=np.ones(N, bool), evaluated=known)
    assert len(calls) == solution.iterations
    assert not any(np.array_equal(x, np.zeros(2)) for x in calls)


def test_the_covariance_is_what_repeated_experiments_scatter_by():
    rng = np.random.default_rng(1)
    A = rng.normal(size=(N, M, 2))
    fits = [
        minimise(linear(A, rng.normal(scale=0.1, size=(N, M))), np.zeros(2), SIGMA, inlier=np.ones(N, bool))
        for _ in range(2000)
    ]
    scatter = np.cov(np.array([fit.x for fit in fits]), rowvar=False)
    assert covariance(fits[0], SIGMA) == pytest.approx(scatter, rel=0.1, abs=0.05 * scatter.max())


def test_the_covariance_survives_parameters_of_very_different_size():
    A = np.random.default_rng(2).normal(size=(N, M, 2)) * [1.0, 1e-9]
    solution = minimise(linear(A, np.zeros((N, M))), np.zeros(2), SIGMA, inlier=np.ones(N, bool))
    J = (A / 0.1).reshape(-1, 2) / [1.0, 1e-9]
    expected = np.linalg.inv(J.T @ J) / np.outer([1.0, 1e-9], [1.0, 1e-9])
    assert covariance(solution, SIGMA) == pytest.approx(expected, rel=1e-6)


def test_the_noise_of_each_group_of_components_is_found_without_bias():
    """Two groups of three readings: their noises are 0.3 and 0.002, and few rows pay for many parameters."""
    rng = np.random.default_rng(3)
    true = np.repeat([0.3, 0.002], 3)
    groups = [slice(0, 3), slice(3, 6)]
    found = []
    for _ in range(100):
        A = rng.normal(size=(6, 6, 9))
        b, sigma = rng.normal(size=(6, 6)) * true, np.full(6, 0.05)
        for _ in range(12):
            solution = minimise(linear(A, b), np.zeros(9), sigma, inlier=np.ones(6, bool))
            sigma = noise_components(solution, sigma, groups)
        found.append(sigma**2)
    assert np.sqrt(np.mean(found, axis=0)) == pytest.approx(true, rel=0.12)


def test_rows_that_were_left_out_do_not_count_as_noise(line_fit):
    A, b = line_fit
    inlier = np.arange(N) >= 10
    b = b.copy()
    b[~inlier] += 1e3
    solution = minimise(linear(A, b), np.zeros(2), SIGMA, inlier=inlier)
    squares = np.sum(solution.residual[inlier] ** 2)
    expected = np.sqrt(squares / (3 * inlier.sum() - 2))
    assert noise_components(solution, SIGMA, [slice(0, 3)]) == pytest.approx(expected, rel=1e-6)


def test_a_model_that_yields_no_numbers_is_refused():
    def evaluate(x):
        return np.full((N, 1), 1.0 if x[0] == 0 else np.nan), np.ones((N, 1, 1))

    with pytest.raises(CalibrationError, match="not finite"):
        minimise(evaluate, np.zeros(1), np.ones(1), inlier=np.ones(N, bool))


def test_a_fit_that_does_not_converge_says_so_instead_of_returning_something():
    def endless(x):  # the minimum lies at infinity
        return np.exp(-x)[:, None], -np.exp(-x)[:, None, None]

    with pytest.raises(CalibrationError, match="did not converge"):
        minimise(endless, np.zeros(1), np.full(1, 1e-70), inlier=np.ones(1, bool))
