"""Visits of one pose count as one, whatever the poses are called and in whatever order they were visited."""

import numpy as np
from truepath.barycentre import barycentres, pose_count

VISITED = np.array([7, 2, 7, 7, 5])


def test_each_pose_is_at_the_mean_of_its_visits():
    readings = np.array([[1.0, 0.0], [5.0, 1.0], [2.0, 0.0], [6.0, 9.0], [8.0, 2.0]])
    np.testing.assert_array_equal(barycentres(readings, VISITED), [[5.0, 1.0], [8.0, 2.0], [3.0, 3.0]])


def test_poses_are_counted_not_visits():
    assert pose_count(VISITED) == 3
    assert pose_count(VISITED[:0]) == 0
