"""Where joints cannot be told, out of reach, at singularities and after an unknown start, that is said."""

import numpy as np
from drake_arm import DrakeArm
from posture_truth import HOME, follow, misses, smooth
from truepath.model import nominal_flange_poses


def test_a_wrist_in_line_leaves_joints_4_and_6_open(ur5):
    q = np.stack([HOME, HOME, HOME])
    q[1, 4] = 0.0
    found = follow(ur5, q, given=[0])
    assert found.ambiguous.tolist() == [False, True, False]
    assert found.certain.tolist() == [True, False, False]
    assert misses(DrakeArm("ur5").flange_poses(found.q_rad), DrakeArm("ur5").flange_poses(q)) < 1e-7


def test_joints_with_the_wrist_in_line_and_the_elbow_stretched_are_a_start(ur5):
    """The home position of every UR: known as joints, but a line from there may go either way."""
    q = np.stack([[0, -np.pi / 2, 0, -np.pi / 2, 0, 0], [0.1, -1.4, 0.5, -1.2, -0.4, 0.1]])
    found = follow(ur5, q, given=[0])
    assert np.abs(found.q_rad - q).max() < 1e-7
    assert follow(ur5, q, given=[0], straight=True).ambiguous.tolist() == [False, True]


def test_poses_out_of_reach_are_not_reached_and_after_them_nothing_is_known(ur5):
    q = smooth(6)
    X = nominal_flange_poses(ur5, q)
    X[2, :3, 3] *= 3
    found = follow(ur5, q, given=[0, 4], X=X)
    assert found.reached.tolist() == [True, True, False, False, True, True]
    assert found.start_unknown.tolist() == [False, False, False, True, False, False]
    assert np.isnan(found.q_rad[2:4]).all()
    assert found.certain.tolist() == found.reached.tolist()


def test_a_pose_inside_the_column_of_the_shoulder_is_out_of_reach(ur5):
    q = smooth(2)
    X = nominal_flange_poses(ur5, q)
    X[1, :3, 3] = [0.0, 0.0, 0.6]
    X[1, :3, :3] = np.diag([1.0, -1.0, -1.0])
    assert follow(ur5, q, given=[0], X=X).reached.tolist() == [True, False]


def test_a_start_that_nobody_knows_is_told_until_joints_are_known_again(ur5):
    q = smooth(8)
    found = follow(ur5, q, given=[4], previous=[-1, 0, 1, 2, 3, 4, -1, 6])
    assert found.start_unknown.tolist() == [True] * 4 + [False, False, True, True]
    assert np.isnan(found.q_rad[found.start_unknown]).all()
    assert np.abs(found.q_rad - q)[4:6].max() < 1e-7
    assert not found.reached[found.start_unknown].any()


def test_targets_that_run_in_circles_have_no_start_unless_joints_are_among_them(ur5):
    q = smooth(6)
    circle = follow(ur5, q, previous=[2, 0, 1, 5, 3, 4], given=[3])
    assert circle.start_unknown.tolist() == [True] * 3 + [False] * 3
    assert np.abs(circle.q_rad - q)[3:].max() < 1e-7


def test_no_targets_are_no_fault(ur5):
    found = follow(ur5, np.empty((0, 6)))
    assert found.q_rad.shape == (0, 6)
    assert found.certain.shape == (0,)
