"""The part of joint space that the data covered."""

import numpy as np
import pytest
from scipy.spatial.distance import mahalanobis
from truepath.region import cover

DEGREE = np.pi / 180


@pytest.fixture
def q():
    return np.random.default_rng(0).uniform(-1, 1, (300, 6)) * [2, 1, 0.5, 1, 1, 3] + [0, -1, 1, 0, 0, 0]


@pytest.fixture
def diagonal():
    """Two joints that always moved together."""
    t = np.linspace(-1, 1, 101)
    return np.stack([t, t], axis=1)


def test_all_the_data_lies_inside_its_own_region(q):
    region = cover(q)
    assert region.contains(q).all()
    assert region.distance(q).max() == pytest.approx(1)


def test_the_bounds_are_the_smallest_and_largest_angles_seen(q):
    region = cover(q)
    np.testing.assert_array_equal(region.lower_rad, q.min(axis=0))
    np.testing.assert_array_equal(region.upper_rad, q.max(axis=0))
    np.testing.assert_allclose(region.mean_rad, q.mean(axis=0))


def test_the_distance_is_mahalanobis_with_a_degree_of_spread_added_in_units_of_the_radius(q):
    region = cover(q)
    inverse = np.linalg.inv(np.cov(q.T) + DEGREE**2 * np.eye(6))
    radius = max(mahalanobis(row, q.mean(axis=0), inverse) for row in q)
    assert region.radius == pytest.approx(radius)
    others = np.random.default_rng(1).normal(size=(20, 6)) * 3
    expected = [mahalanobis(row, q.mean(axis=0), inverse) / radius for row in others]
    np.testing.assert_allclose(region.distance(others), expected)


def test_the_mean_of_the_data_is_at_distance_zero_and_distances_grow_in_proportion(q):
    region, direction = cover(q), np.ones(6)
    steps = region.mean_rad + np.outer([0, 1, 2, 5], direction)
    distances = region.distance(steps)
    assert distances[0] == 0
    np.testing.assert_allclose(distances / distances[1], [0, 1, 2, 5])


@pytest.mark.parametrize("side", [-1, 1])
def test_a_joint_may_go_a_degree_beyond_what_was_seen_and_no_further(side):
    corners = np.array([[-1.0, -0.3], [-1.0, 0.3], [1.0, -0.3], [1.0, 0.3]])
    region = cover(corners)
    just, beyond = (np.array([[0.0, side * (0.3 + degrees * DEGREE)]]) for degrees in (0.99, 1.01))
    assert region.distance(np.vstack([just, beyond])).max() < 0.9  # so it is the interval that decides
    assert region.contains(just)[0]
    assert not region.contains(beyond)[0]


def test_angles_that_were_each_seen_but_never_together_are_outside(diagonal):
    region = cover(diagonal)
    together, apart = np.array([[0.9, 0.9]]), np.array([[0.9, -0.9]])
    assert region.contains(together)[0]
    assert not region.contains(apart)[0]
    assert region.distance(apart)[0] > 10


def test_a_joint_that_never_moved_counts_as_spread_over_a_degree(q):
    q[:, 3] = 0.7
    region = cover(q)
    at_mean = region.mean_rad[None].copy()
    for off, inside in ((0.0, True), (0.9, True), (1.1, False), (-0.9, True), (-1.1, False)):
        pose = at_mean.copy()
        pose[0, 3] += off * DEGREE
        assert region.contains(pose)[0] == inside, off


def test_a_whole_turn_is_another_angle(q):
    assert not cover(q).contains(q[:1] + 2 * np.pi * np.eye(6)[3])[0]


def test_many_poses_are_judged_one_by_one(q):
    region = cover(q)
    mixed = np.vstack([q[:3], q[:3] + 10])
    assert region.contains(mixed).tolist() == [True] * 3 + [False] * 3
