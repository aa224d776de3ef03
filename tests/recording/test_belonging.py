"""Readings of a robot with errors of its own, as Drake has them, against the robot as drawn."""

import numpy as np
import pytest
from truepath.plants import load_robot
from truepath.recording.belonging import Belonging
from truepath.recording.visit import Recorded
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
    assert [belonging.why_not(k, Q[k], p_ME[k]) for k in range(len(Q))] == [""] * len(Q)


def test_the_reading_of_the_pose_before_is_not_believed_and_does_not_count(belonging, p_ME):
    for k in range(8):
        belonging.why_not(k, Q[k], p_ME[k])
    assert "does not belong to this pose" in belonging.why_not(8, Q[8], p_ME[7] + 1e-5)
    assert belonging.why_not(8, Q[8], p_ME[8]) == ""


def test_exactly_the_same_at_two_poses_is_a_frozen_tracker(belonging, p_ME):
    assert belonging.why_not(0, Q[0], p_ME[0]) == ""
    assert belonging.why_not(1, Q[0], p_ME[0]) == ""  # a pose that is visited again, by a tracker of coarse numbers
    with pytest.raises(RobotFault, match="frozen"):
        belonging.why_not(2, Q[1], p_ME[0])


def test_readings_in_another_unit_are_refused_as_soon_as_there_are_enough(belonging, p_ME):
    for k in range(5):
        belonging.why_not(k, Q[k], 25.4 * p_ME[k])
    with pytest.raises(RobotFault, match="1, 2, 3, 4, 5 and 6"):
        belonging.why_not(5, Q[5], 25.4 * p_ME[5])


def test_a_wrong_reading_among_the_first_is_named_when_the_sixth_tells_and_the_sixth_is_not_blamed(belonging, p_ME):
    for k in range(5):
        assert belonging.why_not(k, Q[k], p_ME[1] + 1e-5 if k == 2 else p_ME[k]) == ""
    with pytest.raises(RobotFault, match="visit 3 lies more than 20 mm"):
        belonging.why_not(5, Q[5], p_ME[5])


def recorded(count, p_ME):
    return Recorded(np.arange(count), Q[:count], p_ME[:count])


def test_what_was_recorded_earlier_counts_when_a_recording_goes_on(p_ME):
    """The tracker was set up anew meanwhile: of seven readings there is not one that could be in its new frame."""
    belonging = Belonging(load_robot("ur5"), recorded(7, p_ME))
    assert "does not belong to this pose" in belonging.why_not(7, Q[7], p_ME[7] + [2.0, 0.5, 1.0])
    assert belonging.why_not(7, Q[7], p_ME[7]) == ""


def test_of_few_earlier_readings_and_few_new_ones_in_another_frame_all_are_in_doubt(p_ME):
    belonging = Belonging(load_robot("ur5"), recorded(3, p_ME))
    for k in (3, 4):
        belonging.why_not(k, Q[k], p_ME[k] + [2.0, 0.5, 1.0])
    with pytest.raises(RobotFault, match="1, 2, 3, 4, 5 and 6"):
        belonging.why_not(5, Q[5], p_ME[5] + [2.0, 0.5, 1.0])


def test_a_recording_with_wrong_rows_does_not_go_on(p_ME):
    wrong = p_ME.copy()
    wrong[[4, 9]] += 0.1
    with pytest.raises(RobotFault, match="visit 5 or 10 lies more than 20 mm"):
        Belonging(load_robot("ur5"), recorded(12, wrong))
