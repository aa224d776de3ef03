"""What is left: how much of it is noise, and whether it has a pattern. Noise is drawn here, so its size is known."""

import numpy as np
import pytest
from truepath.leftover import alike_by_chance, more_than_repeats, noise_floor_mm, spread
from truepath.measurements import Measurements

SIGMA_M = 5e-5
# Mean length of a vector of three normal numbers of deviation s (Maxwell): s sqrt(8 / pi).
FLOOR_MM = 1e3 * SIGMA_M * np.sqrt(8.0 / np.pi)


def joints(count, seed=0, spread=2.0):
    return np.random.default_rng(seed).uniform(-spread, spread, (count, 6))


def noise(count, seed=1, components=3):
    return np.random.default_rng(seed).normal(scale=SIGMA_M, size=(count, components))


def pattern(q):
    """A smooth function of the pose, larger than the noise."""
    return 4.0 * SIGMA_M * np.stack([np.sin(q[:, 0]), np.cos(q[:, 1]), np.sin(q[:, 2])], axis=1)


def measured(q, **more):
    return Measurements(q, np.zeros((len(q), 3)), **more)


# The noise floor


def test_repeats_give_the_true_noise_whatever_is_left_of_each_pose():
    """Errors that all visits of a pose share are none of the noise."""
    q = joints(100)
    visits = np.tile(np.arange(100), 4)
    residual = pattern(q)[visits] + noise(400)
    floor, source = noise_floor_mm(measured(q[visits], pose_id=visits), residual)
    assert source == "repeats"
    assert floor == pytest.approx(FLOOR_MM, rel=0.05)


def test_repeats_are_known_by_their_joints_where_nobody_numbered_them():
    q = np.tile(joints(100), (4, 1))
    floor, source = noise_floor_mm(measured(q), pattern(q) + noise(400))
    assert source == "repeats"
    assert floor == pytest.approx(FLOOR_MM, rel=0.05)


def test_without_repeats_neighbours_give_the_noise():
    """Poses along a path, 0.2 degrees from one to the next."""
    q = np.outer(np.linspace(0, 2, 600), np.ones(6)) + 1e-3 * joints(600)
    floor, source = noise_floor_mm(measured(q), pattern(q) + noise(600))
    assert source == "neighbours"
    assert floor == pytest.approx(FLOOR_MM, rel=0.1)


def test_neighbours_give_the_true_noise_where_nothing_else_is_left_however_far_apart_they_are():
    floor, source = noise_floor_mm(measured(joints(400)), noise(400))
    assert source == "neighbours"
    assert floor == pytest.approx(FLOOR_MM, rel=0.1)


def test_a_joint_that_never_moved_does_not_decide_who_is_whose_neighbour():
    q = np.outer(np.linspace(0, 2, 600), np.ones(6))
    q[:, 5] = 1e-9 * np.random.default_rng(0).normal(size=600)
    floor, _ = noise_floor_mm(measured(q), 10 * pattern(q) + noise(600))
    assert floor == pytest.approx(FLOOR_MM, rel=0.15)


def test_a_handful_of_repeats_is_no_measure_of_noise():
    q = joints(100)
    q[50:54] = q[:4]
    assert noise_floor_mm(measured(q), noise(100))[1] == "neighbours"
    q[54] = q[4]
    assert noise_floor_mm(measured(q), noise(100))[1] == "repeats"


def test_the_floor_is_one_of_positions_even_where_orientation_is_measured():
    residual = np.concatenate([noise(400), 100.0 * noise(400, seed=2)], axis=1)
    assert noise_floor_mm(measured(joints(400)), residual)[0] == pytest.approx(FLOOR_MM, rel=0.1)


# More than repeats allow


def test_residuals_of_nothing_but_noise_are_no_larger_than_repeats_allow_and_their_chances_are_even():
    """A quarter of 300 p values below a quarter, half below a half, all of it within what a binomial does."""
    visits = np.tile(np.arange(40), 3)
    q = joints(40)[visits]
    found = np.array([more_than_repeats(measured(q, pose_id=visits), noise(120, seed)) for seed in range(300)])
    for level in (0.05, 0.25, 0.5):
        assert abs(np.sum(found < level) - 300 * level) < 3.5 * np.sqrt(300 * level * (1 - level))


def test_errors_that_all_visits_of_a_pose_share_are_more_than_repeats_allow():
    visits = np.tile(np.arange(40), 3)
    q = joints(40)
    residual = 0.3 * pattern(q)[visits] + noise(120)
    assert more_than_repeats(measured(q[visits], pose_id=visits), residual) < 1e-6


def test_without_repeats_nobody_can_say_what_they_allow():
    assert more_than_repeats(measured(joints(100)), pattern(joints(100)) + noise(100)) == 1.0


# Patterns


def chance(q, residual, *views, time=False):
    """Probability of such likeness, in all joints, one joint or two, or in time."""
    spaces = [spread(q)] if not time else [spread(q), np.arange(len(q))[:, None]]
    return alike_by_chance(residual, np.full(residual.shape[1], SIGMA_M), spaces, views)


@pytest.fixture(scope="module")
def by_chance():
    """300 probabilities for residuals that are nothing but noise, in several spaces and views."""
    found = []
    for seed in range(300):
        q = joints(150, seed)
        view = np.broadcast_to(np.eye(3), (150, 3, 3))
        found.append(chance(q, noise(150, 1000 + seed), view, time=True))
    return np.array(found)


def test_noise_looks_like_a_pattern_no_more_often_than_the_probability_says(by_chance):
    assert np.sum(by_chance < 0.05) <= 26  # 99.9 % of binomial draws of 300 at 0.05
    assert np.sum(by_chance < 0.001) <= 4


def test_probabilities_are_probabilities_and_often_large(by_chance):
    assert ((by_chance >= 0) & (by_chance <= 1)).all()
    assert np.median(by_chance) > 0.4


def test_the_more_places_are_searched_the_more_a_likeness_has_to_be():
    q, residual = joints(200), 0.2 * pattern(joints(200)) + noise(200)
    few = alike_by_chance(residual, np.full(3, SIGMA_M), [spread(q)], [])
    many = alike_by_chance(residual, np.full(3, SIGMA_M), [spread(q), *[joints(200, k) for k in range(3, 12)]], [])
    assert many >= min(1.0, few)


def test_what_goes_with_the_pose_is_told_from_noise():
    q = joints(300, spread=1.0)
    assert chance(q, pattern(2 * q) + noise(300)) < 1e-6


def test_what_goes_with_a_single_joint_is_told_where_poses_are_alike_in_that_joint():
    q = joints(300)
    residual = SIGMA_M * np.sin(5 * q[:, [3]]) * np.ones(3) + noise(300)
    sigma = np.full(3, SIGMA_M)
    assert alike_by_chance(residual, sigma, [q[:, [3]]], []) < 1e-4
    assert alike_by_chance(residual, sigma, [q], []) > 1e-3


def test_what_goes_with_time_is_told_from_noise_though_poses_came_in_random_order():
    drift = 3.0 * SIGMA_M * np.sin(np.linspace(0, 20, 300))[:, None]
    assert chance(joints(300), drift + noise(300), time=True) < 1e-6


def test_an_error_along_an_axis_that_turns_with_the_robot_is_seen_in_the_view_along_that_axis():
    """Constant along an axis that points elsewhere at every pose: in the tracker's axes it looks like noise."""
    axis = np.random.default_rng(5).normal(size=(300, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    residual = SIGMA_M * axis + noise(300)
    assert chance(joints(300), residual, axis[:, :, None]) < 1e-6
    assert chance(joints(300), residual) > 1e-3


def test_gross_errors_among_strangers_make_no_pattern():
    residual = noise(300)
    residual[[40, 100, 220]] = 1.0
    assert chance(joints(300), residual, time=True) > 0.001


def test_errors_that_go_against_those_of_their_neighbours_are_no_pattern_that_a_model_lacks():
    residual = 3.0 * SIGMA_M * (-1.0) ** np.arange(300)[:, None] + 0.1 * noise(300)
    along = np.arange(300)[:, None]
    one_step_on = alike_by_chance(residual, np.full(3, SIGMA_M), [along], [])
    assert one_step_on > 0.01
