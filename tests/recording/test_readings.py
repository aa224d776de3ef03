"""Averages of readings; the truth is what the noise was added to."""

import numpy as np
from scipy.spatial.transform import Rotation
from truepath.recording.readings import average

PLACE_MM = np.array([1500.0, -200.0, 900.0])


def noisy(count, noise_mm=0.03):
    p = PLACE_MM + np.random.default_rng(0).normal(scale=noise_mm, size=(count, 3))
    return np.column_stack([np.arange(count) / 100.0, p])


def test_the_mean_is_nearer_than_a_single_reading_and_the_spread_is_that_of_the_noise():
    reading = average(noisy(400))
    assert np.abs(1e3 * reading.p_ME - PLACE_MM).max() < 4 * 0.03 / np.sqrt(400)
    assert 0.95 < reading.spread_mm / (np.sqrt(3) * 0.03) < 1.05
    assert reading.count >= 395
    assert reading.t_s == 3.99


def test_glints_do_not_count():
    readings = noisy(100)
    readings[[3, 50, 77], 1:] += [40.0, -3.0, 900.0]
    reading = average(readings)
    assert reading.count <= 97
    assert np.abs(1e3 * reading.p_ME - PLACE_MM).max() < 0.015


def test_of_a_few_readings_none_is_left_out_but_their_spread_tells():
    readings = noisy(3)
    readings[0, 1:] += [0.0, 0.0, 3.0]
    reading = average(readings)
    assert reading.count == 3
    assert reading.spread_mm > 1.0


def test_equal_readings_have_no_spread():
    reading = average(np.tile([1.0, 1.0, 2.0, 3.0], (5, 1)))
    assert (reading.count, reading.spread_mm) == (5, 0.0)


def test_orientations_are_averaged_whichever_sign_their_quaternions_have():
    truth = Rotation.from_rotvec([0.3, -2.0, 1.1])
    turns = np.random.default_rng(1).normal(scale=1e-3, size=(300, 3))
    quaternions = (truth * Rotation.from_rotvec(turns)).as_quat(scalar_first=True)
    quaternions[::2] *= -1.0
    reading = average(np.column_stack([noisy(300), quaternions]))
    assert (Rotation.from_matrix(reading.R_ME) * truth.inv()).magnitude() < 3e-4
