"""Networks speak where the data reached, fall silent where it did not, and smoothly between."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from truepath.residual.reach import Reach

DEGREE = np.pi / 180
CENTRE = np.array([0.3, -1.2, 1.0, -0.5, 0.8, 0.0])


def poses(count, seed, half_range=1.0):
    """``(count, 6)`` drawn evenly from a box."""
    return CENTRE + half_range * np.random.default_rng(seed).uniform(-1, 1, (count, 6))


def band(count, seed):
    """Two joints that always moved nearly together, over two radians."""
    along, across = np.random.default_rng(seed).uniform(-1, 1, (2, count))
    return np.stack([along + 0.05 * across, along - 0.05 * across], axis=1)


@pytest.fixture(scope="module")
def measured():
    return poses(400, 0)


@pytest.fixture(scope="module")
def reach(measured):
    return Reach.of(measured)


# Inside


@pytest.mark.parametrize("count", [2, 3, 10, 60, 400, 900])
@pytest.mark.parametrize("kind", [poses, band])
def test_at_measured_poses_the_weight_is_1_but_for_the_loneliest(kind, count):
    q = kind(count, 1)
    weight = Reach.of(q).weight(q)
    assert weight.min() >= 0
    assert weight.max() <= 1
    assert (weight > 1 - 1e-9).mean() >= 0.99


@pytest.mark.parametrize("count", [300, 1200])
@pytest.mark.parametrize("kind", [poses, band])
def test_at_fresh_poses_of_the_same_kind_the_weight_is_nearly_always_1(kind, count):
    weight = Reach.of(kind(count, 1)).weight(kind(2000, 2))
    assert (weight > 0.99).mean() > 0.95
    assert weight.mean() > 0.98


def test_few_poses_reach_nearly_as_far_for_a_fresh_one_often_lies_beyond_all_of_them_in_some_joint():
    assert Reach.of(poses(60, 1)).weight(poses(2000, 2)).mean() > 0.8


def test_visits_of_the_same_poses_again_reach_as_far_as_one_visit(measured):
    few = measured[:100]
    once, often = Reach.of(few), Reach.of(np.tile(few, (20, 1)))
    fresh = poses(500, 3)
    np.testing.assert_allclose(often.weight(fresh), once.weight(fresh), atol=1e-6)


def test_thirty_poses_visited_a_hundred_times_are_no_reason_to_be_silent_between_them(measured):
    slack = 1e-5 * np.random.default_rng(4).normal(size=(3000, 6))
    once, often = Reach.of(measured[:30]), Reach.of(np.tile(measured[:30], (100, 1)) + slack)
    fresh = poses(500, 3)
    np.testing.assert_allclose(often.weight(fresh), once.weight(fresh), atol=0.02)


# Outside


@pytest.mark.parametrize("beyond", [10, 20, 90])
@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("joint", range(6))
def test_ten_degrees_beyond_what_a_joint_saw_the_weight_is_0(measured, reach, joint, side, beyond):
    limit = measured[:, joint].max() if side > 0 else measured[:, joint].min()
    there = measured[:50].copy()
    there[:, joint] = limit + side * (beyond + 1e-9) * DEGREE
    assert (reach.weight(there) == 0).all()


def test_where_joints_were_each_but_never_together_the_weight_is_0():
    reach = Reach.of(band(400, 0))
    across = np.array([[0.8, -0.8], [-0.8, 0.8], [0.5, -0.5], [0.0, 0.6]])
    assert (np.abs(across) <= 1).all()
    assert (reach.weight(across) == 0).all()
    assert (reach.weight(np.array([[0.8, 0.8], [0.0, 0.0]])) > 0.999).all()


def test_a_hole_in_the_data_is_outside():
    ring = np.random.default_rng(0).uniform(-1, 1, (3000, 2))
    ring = ring[np.linalg.norm(ring, axis=1) > 0.6]
    reach = Reach.of(ring)
    assert reach.weight(np.zeros((1, 2)))[0] == 0
    assert (reach.weight(ring) > 0.999).mean() > 0.98


def test_far_away_the_weight_is_0_and_a_number(reach):
    for far in (1e2, 1e6, 1e12):
        assert reach.weight(CENTRE[None] + far)[0] == 0


def test_a_whole_turn_is_another_angle(measured, reach):
    assert reach.weight(measured[:1] + 2 * np.pi * np.eye(6)[3])[0] == 0


# Between


def _along(reach, start, end, count=20001):
    """Step length, and the weight on a straight line."""
    t = np.linspace(0, 1, count)[:, None]
    return 1 / (count - 1), reach.weight((1 - t) * start + t * end)


@pytest.mark.parametrize("joint", range(6))
def test_on_the_way_out_of_a_joint_s_range_the_weight_falls_without_step_or_kink(measured, reach, joint):
    inside, outside = CENTRE.copy(), CENTRE.copy()
    outside[joint] = measured[:, joint].max() + 25 * DEGREE
    step, weight = _along(reach, inside, outside)
    slope = np.diff(weight) / step
    assert weight[-1] == 0
    assert weight.max() > 0.5
    assert np.abs(np.diff(weight)).max() < 0.002
    # a kink would be a step of the slope, however fine the line
    assert np.abs(np.diff(slope)).max() < 0.02 * np.abs(slope).max()


def test_on_the_way_out_of_a_band_the_weight_falls_without_step_or_kink():
    reach = Reach.of(band(400, 0))
    for start, end in (((0.2, 0.2), (0.9, -0.5)), ((-0.5, -0.5), (0.7, -0.7)), ((-0.9, -0.9), (0.9, 0.2))):
        step, weight = _along(reach, np.array(start), np.array(end))
        slope = np.diff(weight) / step
        assert np.ptp(weight) == pytest.approx(1, abs=1e-6)
        assert np.abs(np.diff(weight)).max() < 0.01
        assert np.abs(np.diff(slope)).max() < 0.05 * np.abs(slope).max()


@hypothesis_settings(max_examples=30)
@given(seed=st.integers(0, 10**6), size=st.floats(1e-9, 1e-6))
def test_a_small_step_anywhere_changes_the_weight_little(reach, seed, size):
    rng = np.random.default_rng(seed)
    q = CENTRE + rng.uniform(-1.6, 1.6, (200, 6))
    step = size * rng.uniform(-1, 1, (200, 6))
    assert np.abs(reach.weight(q + step) - reach.weight(q)).max() < 40 * size * np.sqrt(6)


# Odd campaigns


def test_a_joint_that_never_moved_reaches_some_degrees_no_further(measured):
    still = measured.copy()
    still[:, 3] = 0.7
    reach = Reach.of(still)
    assert (reach.weight(still) > 1 - 1e-9).mean() >= 0.99
    for degrees, largest in ((0.0, 1.0), (10.0, 0.0), (20.0, 0.0)):
        there = still.copy()
        there[:, 3] += degrees * DEGREE * (1 + 1e-9)
        assert reach.weight(there).max() <= largest
    fresh = poses(500, 8)
    fresh[:, 3] = 0.7
    assert reach.weight(fresh).mean() > 0.98


def test_two_poses_reach_their_own_neighbourhood():
    q = np.array([[0.0, 0.0], [1.0, 0.5]])
    reach = Reach.of(q)
    np.testing.assert_allclose(reach.weight(q), 1)
    assert reach.weight(np.array([[3.0, 2.0]]))[0] == 0


def test_no_joint_moved_at_all_and_still_nothing_is_nan():
    reach = Reach.of(np.zeros((5, 3)))
    assert reach.weight(np.zeros((1, 3)))[0] == 1
    assert np.isfinite(reach.weight(np.random.default_rng(0).normal(size=(50, 3)))).all()


def test_many_poses_are_weighed_as_each_alone(reach):
    q = np.concatenate([poses(4500, 5), poses(500, 6, 1.5)])
    one_by_one = np.array([reach.weight(row[None])[0] for row in q[::250]])
    np.testing.assert_allclose(reach.weight(q)[::250], one_by_one, atol=1e-12)


def test_no_pose_has_no_weight(reach):
    assert reach.weight(np.zeros((0, 6))).shape == (0,)


def test_measured_joints_are_scaled_to_between_minus_1_and_1(measured, reach):
    scaled = reach.scaled(measured)
    np.testing.assert_allclose(scaled.min(axis=0), -1, atol=1e-12)
    np.testing.assert_allclose(scaled.max(axis=0), 1, atol=1e-12)
