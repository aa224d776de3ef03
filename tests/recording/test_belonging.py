"""Readings of a robot with errors of its own, as Drake has them, against the robot as drawn."""

import numpy as np
import pytest
from truepath.plants import load_robot
from truepath.recording.belonging import Belonging
from truepath.robot_link import RobotFault
from truepath.virtual.real_robot import RealRobot
from virtual_robot import HOME

Q = HOME + np.random.default_rng(4).uniform(-0.5, 0.5, (12, 6))


@pytest.fixture(scope="module")
def p_ME():
    return RealRobot("ur5_cell", 3).reflector_poses(Q)[:, :3, 3]


@pytest.fixture
def belonging():
    return Belonging(load_robot("ur5"))


def test_a_robot_with_errors_is_believed_wherever_the_tracker_and_the_reflector_are(belonging, p_ME):
    assert [belonging.why_not(q, p) for q, p in zip(Q, p_ME, strict=True)] == [""] * len(Q)


def test_the_reading_of_the_pose_before_is_not_believed_and_does_not_count(belonging, p_ME):
    for q, p in zip(Q[:8], p_ME[:8], strict=True):
        belonging.why_not(q, p)
    assert "does not belong to this pose" in belonging.why_not(Q[8], p_ME[7] + 1e-5)
    assert belonging.why_not(Q[8], p_ME[8]) == ""


def test_exactly_the_same_at_two_poses_is_a_frozen_tracker(belonging, p_ME):
    assert belonging.why_not(Q[0], p_ME[0]) == ""
    assert belonging.why_not(Q[0], p_ME[0]) == ""  # a pose that is visited again, by a tracker of coarse numbers
    with pytest.raises(RobotFault, match="frozen"):
        belonging.why_not(Q[1], p_ME[0])


def test_readings_in_another_unit_are_refused_as_soon_as_there_are_enough(belonging, p_ME):
    for q, p in zip(Q[:5], 25.4 * p_ME[:5], strict=True):
        belonging.why_not(q, p)
    with pytest.raises(RobotFault, match="do not belong"):
        belonging.why_not(Q[5], 25.4 * p_ME[5])
