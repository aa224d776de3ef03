"""By how many whole turns the joints go from pose to pose, up to their limits."""

from dataclasses import replace

import numpy as np
from posture_truth import HOME, TURN, follow


def in_one_posture(robot):
    """The same arm with limits that leave room for joint 6 only."""
    lower, upper = HOME - 0.3, HOME + 0.3
    lower[5], upper[5] = -TURN, TURN
    return replace(robot, lower_rad=lower, upper_rad=upper)


def test_a_joint_turns_on_past_half_a_turn_and_back(ur5):
    q = np.tile(HOME, (200, 1))
    q[:, 5] = 5.9 * np.sin(np.linspace(0, TURN, 200))
    q[:, 0] = -3.5 * np.sin(np.linspace(0, TURN, 200))
    for straight in (False, True):
        found = follow(ur5, q, given=[0], straight=straight)
        assert np.abs(found.q_rad - q).max() < 1e-7


def test_at_its_limit_a_joint_turns_back_by_a_whole_turn_but_not_along_a_line(ur5):
    arm = in_one_posture(ur5)
    q = np.tile(HOME, (80, 1))
    q[:, 5] = np.linspace(5.5, 7.0, 80)
    beyond = q[:, 5] > TURN
    found = follow(arm, q, given=[0])
    assert found.reached.all()
    assert np.abs(found.q_rad - q + np.outer(beyond, [0, 0, 0, 0, 0, TURN])).max() < 1e-7
    line = follow(arm, q, given=[0], straight=True)
    assert np.array_equal(line.reached, ~beyond)
    assert np.abs(line.q_rad - q)[~beyond].max() < 1e-7
    first = int(np.argmax(beyond))
    assert not line.start_unknown[: first + 1].any()
    assert line.start_unknown[first + 1 :].all()


def test_half_a_turn_either_way_is_ambiguous_unless_a_limit_forbids_one(ur5):
    arm = in_one_posture(ur5)
    q = np.stack([HOME, HOME])
    q[1, 5] += np.pi - 0.01
    assert follow(arm, q, given=[0]).ambiguous.tolist() == [False, True]
    bounded = replace(arm, lower_rad=np.array([*arm.lower_rad[:5], -1.0]))
    assert not follow(bounded, q, given=[0]).ambiguous.any()


def test_joints_many_turns_away_are_no_place_to_start_from(ur5):
    q = np.stack([HOME, HOME])
    q[0, 0] = 1e4
    found = follow(ur5, q, given=[0])
    assert found.start_unknown.tolist() == [False, True]
    assert np.isnan(found.q_rad[1]).all()
