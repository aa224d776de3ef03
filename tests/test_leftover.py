"""What is left: how much of it is noise, and whether it has a pattern. Noise is drawn here, so its size is known."""

import numpy as np
import pytest
from truepath.leftover import alike_by_chance, noise_floor_mm
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


# Patterns


@pytest.fixture(scope="module")
def by_chance():
    """300 probabilities for residuals that are nothing but noise."""
    found = []
    for seed in range(300):
        q = joints(150, seed)
        found.append(alike_by_chance(measured(q), noise(150, 1000 + seed), np.full(3, SIGMA_M)))
    return np.array(found)


def test_noise_looks_like_a_pattern_no_more_often_than_the_probability_says(by_chance):
    assert np.sum(by_chance < 0.05) <= 26  # 99.9 % of binomial draws of 300 at 0.05
    assert np.sum(by_chance < 0.001) <= 4


def test_probabilities_are_probabilities_and_often_large(by_chance):
    assert ((by_chance >= 0) & (by_chance <= 1)).all()
    assert np.median(by_chance) > 0.4


def test_what_goes_with_the_pose_is_told_from_noise():
    q = joints(300, spread=1.0)
    assert alike_by_chance(measured(q), pattern(2 * q) + noise(300), np.full(3, SIGMA_M)) < 1e-6


def test_what_goes_with_time_is_told_from_noise_though_poses_came_in_random_order():
    drift = 3.0 * SIGMA_M * np.sin(np.linspace(0, 20, 300))[:, None]
    assert alike_by_chance(measured(joints(300)), drift + noise(300), np.full(3, SIGMA_M)) < 1e-6


def test_a_pattern_of_orientation_alone_is_seen():
    q = joints(300, spread=1.0)
    residual = np.concatenate([noise(300), pattern(2 * q) + noise(300, 2)], axis=1)
    assert alike_by_chance(measured(q), residual, np.full(6, SIGMA_M)) < 1e-6


def test_two_gross_errors_side_by_side_make_no_pattern():
    residual = noise(300)
    residual[[100, 101]] = 1.0
    q = joints(300)
    q[101] = q[100] + 1e-4
    assert alike_by_chance(measured(q), residual, np.full(3, SIGMA_M)) > 0.001


def test_errors_that_go_against_those_of_their_neighbours_are_no_pattern_that_a_model_lacks():
    residual = 3.0 * SIGMA_M * (-1.0) ** np.arange(300)[:, None] + 0.1 * noise(300)
    along = np.outer(np.linspace(0, 2, 300), np.ones(6))
    assert alike_by_chance(measured(along), residual, np.full(3, SIGMA_M)) > 0.01
