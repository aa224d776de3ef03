"""Data that cannot carry a calibration, or are not what they are said to be, are refused with the likely reason."""

from dataclasses import replace

import numpy as np
import pytest
from truepath.calibrate import calibrate
from truepath.errors import CalibrationError
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure

POSES = 300
WITH_ORIENTATION = Campaign(orientation_noise_mrad=0.05)


@pytest.fixture(scope="module")
def real():
    """A robot with hidden errors."""
    return RealRobot("ur5", 0)


@pytest.fixture(scope="module")
def joints(real):
    """Joints free of collision."""
    return free_poses(real, POSES, np.random.default_rng(0))


@pytest.fixture(scope="module")
def data(real, joints):
    return measure(real, joints, Campaign())


def refusal(robot, data):
    with pytest.raises(CalibrationError) as caught:
        calibrate(robot, data)
    return str(caught.value)


def test_too_few_poses_are_refused_with_the_number_needed(real, data, joints):
    text = refusal(real.robot, data.subset(np.arange(9)))
    assert "too few poses for 27 parameters" in text
    assert "at least 12 different poses" in text
    assert "found:    9" in text
    calibrate(real.robot, data.subset(np.arange(12)))
    text = refusal(real.robot, measure(real, joints[:7], WITH_ORIENTATION))
    assert "at least 8 different poses with 6 readings each" in text


def test_repeated_visits_count_as_one_pose(real, joints):
    text = refusal(real.robot, measure(real, joints[:9], Campaign(repeats=10)))
    assert "too few poses" in text
    assert "found:    9" in text


def test_poses_that_are_all_alike_are_refused(real, joints):
    text = refusal(real.robot, measure(real, np.tile(joints[:1], (40, 1)), Campaign()))
    assert "all poses are alike" in text
    assert "joints that move" in text


def test_repeated_visits_count_as_one_pose_without_their_pose_id_too(real, joints):
    text = refusal(real.robot, measure(real, np.tile(joints[:3], (20, 1)), Campaign()))
    assert "too few poses" in text
    assert "found:    3" in text


@pytest.mark.parametrize("moving", [0, 5], ids=["joint 1", "joint 6"])
def test_poses_in_which_a_single_joint_moves_are_refused(real, joints, moving):
    q = np.tile(joints[:1], (40, 1))
    q[:, moving] = np.linspace(-3, 3, 40)
    refusal(real.robot, measure(real, q, Campaign()))


@pytest.mark.parametrize("campaign", [Campaign(), WITH_ORIENTATION], ids=["3d", "6d"])
@pytest.mark.parametrize(
    ("field", "factor"),
    [("q_rad", 180 / np.pi), ("q_rad", np.pi / 180), ("p_ME", 1e3), ("p_ME", 1e-3)],
    ids=["degrees as radians", "radians as degrees", "mm as m", "m as mm"],
)
def test_mixed_up_units_are_refused_and_suspected(real, joints, campaign, field, factor):
    data = measure(real, joints[:POSES], campaign)
    text = refusal(real.robot, replace(data, **{field: factor * getattr(data, field)}))
    assert "radians and degrees or mm and m mixed up" in text


def test_the_data_of_another_robot_are_refused(data, ur10):
    assert "another robot" in refusal(ur10, data)


def test_joints_in_another_order_are_refused(real, data):
    assert "joints in another order" in refusal(real.robot, replace(data, q_rad=data.q_rad[:, ::-1]))


def test_quaternions_that_turn_the_other_way_are_refused(real, joints):
    data = measure(real, joints[:60], Campaign(orientation_noise_mrad=0.05))
    text = refusal(real.robot, replace(data, R_ME=np.swapaxes(data.R_ME, 1, 2)))
    assert "qw, qx, qy, qz" in text
