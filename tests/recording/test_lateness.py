"""Readings that were kept back are recognised by two clocks; the moments in these tests are made by hand."""

import numpy as np
from truepath.recording.lateness import Lateness


def test_what_comes_through_at_once_is_taken_when_it_arrives():
    clocks = Lateness()
    for k in range(50):
        assert np.isclose(clocks.moments(100.0 + k, np.array([7.0 + k])), 100.0 + k)


def test_a_block_of_readings_is_as_old_as_its_clock_says():
    clocks = Lateness()
    moments = clocks.moments(100.0, np.array([1.0, 4.0, 9.0]))  # the newest is taken to be fresh
    assert np.allclose(moments, [92.0, 95.0, 100.0])


def test_what_was_kept_back_is_older_than_its_arrival():
    clocks = Lateness()
    clocks.moments(100.0, np.array([10.0]))
    assert np.isclose(clocks.moments(130.0, np.array([32.0])), 122.0)


def test_clocks_may_drift_apart_for_hours():
    clocks = Lateness()
    for k in range(4000):  # eleven hours; the tracker's clock is slow by 50 ppm
        moment = clocks.moments(10.0 * k, np.array([10.0 * k * (1 - 50e-6)]))
        assert abs(moment[0] - 10.0 * k) < 0.02
