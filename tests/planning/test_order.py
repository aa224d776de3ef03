"""The order of visits: short, and time goes along with nothing else."""

import numpy as np
import pytest
from truepath.planning.order import Mixing, mixed_order, standardised

N = 48
NOBODY = np.zeros((0, 2), int)


@pytest.fixture(scope="module")
def poses():
    """Stops on the way from one end of joint 1 to the other, the other joints at random."""
    q = np.random.default_rng(0).uniform(-2, 2, (N, 6))
    q[:, 0] = np.linspace(-3, 3, N)
    return q


def ways(q):
    points = np.vstack([q, np.zeros(6)])
    return np.abs(points[:, None] - points).max(axis=2)


def tour(q, order):
    points = np.vstack([np.zeros(6), q[order], np.zeros(6)])
    return np.abs(np.diff(points, axis=0)).max(axis=1).sum()


def correlations(q, order):
    """Numpy's own, of the order with each joint."""
    return np.array([np.corrcoef(np.arange(N), q[order, i])[0, 1] for i in range(6)])


def test_every_stop_is_visited_once_with_time_hardly_correlated_with_any_joint(poses):
    order = mixed_order(ways(poses), standardised(poses, np.zeros((N, 3, 0))), NOBODY, np.random.default_rng(0))
    assert sorted(order) == list(range(N))
    assert np.abs(correlations(poses, order)).max() < 0.15
    assert abs(correlations(poses, np.arange(N))[0]) > 0.99  # a sweep, as the stops were given


def test_the_way_is_much_shorter_than_in_an_order_by_chance(poses):
    rng = np.random.default_rng(1)
    order = mixed_order(ways(poses), standardised(poses, np.zeros((N, 3, 0))), NOBODY, rng)
    by_chance = [tour(poses, rng.permutation(N)) for _ in range(100)]
    assert tour(poses, order) < 0.85 * min(by_chance)


def test_visits_of_one_pose_lie_far_apart_in_time(poses):
    q = poses.copy()
    q[40:44] = q[:4]
    twins = np.array([[0, 40], [1, 41], [2, 42], [3, 43]])
    order = mixed_order(ways(q), standardised(q, np.zeros((N, 3, 0))), twins, np.random.default_rng(2))
    place = np.argsort(order)
    assert np.abs(place[twins[:, 0]] - place[twins[:, 1]]).min() >= N // 5


def test_mixing_tells_the_correlations_that_numpy_does(poses):
    rows = np.random.default_rng(3).normal(size=(N, 3, 2))
    mixing = Mixing.of(poses, rows)
    np.testing.assert_allclose(mixing.joints, correlations(poses, np.arange(N)), atol=1e-12)
    expected = [np.corrcoef(np.arange(N), column)[0, 1] for column in rows.reshape(N, -1).T]
    np.testing.assert_allclose(mixing.columns, expected, atol=1e-12)


def test_what_never_changes_goes_along_with_nothing():
    mixing = Mixing.of(np.ones((5, 6)), np.ones((5, 3, 1)))
    assert mixing.worst == 0.0


def test_the_same_seed_gives_the_same_order(poses):
    few = poses[::4]
    Z = standardised(few, np.zeros((len(few), 3, 0)))
    one, other = (mixed_order(ways(few), Z, NOBODY, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_stops_are_no_problem(poses, count):
    q = poses[:count]
    order = mixed_order(ways(q), standardised(q, np.zeros((count, 3, 0))), NOBODY, np.random.default_rng(0))
    assert sorted(order) == list(range(count))
