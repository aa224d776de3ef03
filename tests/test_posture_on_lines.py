"""Along a straight line the posture stays; where a line leads is followed in small steps."""

import numpy as np
import pytest
from posture_truth import HOME, all_solutions, along_line, follow, with_turns
from truepath.model import nominal_flange_poses


@pytest.mark.parametrize(
    "q",
    [
        [[0.2, -0.2, 0.4, 0.0, -2.0, 0.1], [1.1, -1.6, 1.4, -2.0, -1.1, 1.3]],
        [[0.8, -1.5, 0.5, -0.1, -2.8, -0.2], [1.5, -2.0, 2.2, -0.8, -0.4, 2.0]],
    ],
    ids=["elbow", "shoulder"],
)
def test_along_a_line_the_posture_stays_although_another_is_nearer(ur5, q):
    q = np.array(q)
    X = nominal_flange_poses(ur5, q)
    line, way = follow(ur5, q, given=[0], straight=True), follow(ur5, q, given=[0])
    assert np.abs(along_line(ur5, q[0], X[1], steps=150) - q[1]).max() < 1e-6
    assert np.abs(line.q_rad[1] - q[1]).max() < 1e-6
    others = with_turns(all_solutions(ur5, X[1]), ur5.lower_rad, ur5.upper_rad)
    nearest = others[np.argmin(np.linalg.norm(others - q[0], axis=1))]
    assert np.abs(way.q_rad[1] - nearest).max() < 1e-6
    assert np.abs(nearest - q[1]).max() > 0.5
    assert line.certain.all()


def test_lines_end_where_small_steps_lead(ur5):
    rng = np.random.default_rng(5)
    followed = 0
    for _ in range(12):
        q = HOME + rng.uniform(-0.9, 0.9, (2, 6))
        q[1, 3:] += rng.uniform(-1.2, 1.2, 3)
        line = follow(ur5, q, given=[0], straight=True)
        try:
            end = along_line(ur5, q[0], nominal_flange_poses(ur5, q)[1], steps=60)
        except AssertionError:
            continue  # the line itself is out of reach somewhere, or singular
        assert np.abs(line.q_rad[1] - end).max() < 1e-6
        followed += 1
    assert followed > 3


def test_a_joint_that_turns_far_on_a_line_is_followed_all_the_way(ur5):
    """Past the axis of the base, tool down: joint 1 sweeps by nearly half a turn, joint 6 by as much the other way."""
    q = np.array([1.2, -1.9, 2.3, -1.97, -np.pi / 2, 0.4])
    X = nominal_flange_poses(ur5, q[None])[0]
    goal = X.copy()
    goal[:2, 3] = X[:2, 3] - 2 * 0.999 * X[:2, 3] + 0.25 * np.array([-X[1, 3], X[0, 3]]) / np.hypot(*X[:2, 3])
    end = along_line(ur5, q, goal, steps=500)
    assert np.abs(end - q).max() > 2.0
    found = follow(ur5, np.stack([q, end]), given=[0], straight=True, X=np.stack([X, goal]))
    assert np.abs(found.q_rad[1] - end).max() < 1e-6
    assert found.certain[1]


def test_a_line_through_a_singularity_is_ambiguous(ur5):
    """Axis 5 upright and the tool level, never turning: joints 1 and 5 turn alike, and joint 5 through zero."""
    q = np.array([[0.3, -1.2, 1.9, -0.7, 0.3, 0.4], [-0.3, -1.2, 1.9, -0.7, -0.3, 0.4]])
    X = nominal_flange_poses(ur5, q)
    assert np.abs(X[0, :3, :3] - X[1, :3, :3]).max() < 1e-12
    found = follow(ur5, q, given=[0], straight=True)
    assert found.ambiguous.tolist() == [False, True]
    assert found.reached.all()
