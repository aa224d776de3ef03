"""The unmodified ur_rtde moves the robot: where it goes on the way and where it ends, by Drake."""

from itertools import pairwise

import numpy as np
import pytest
from drawn_robot import SPEED_UP, TOOL, apart, until
from truepath.virtual.real_robot import RealRobot
from truth_by_drake import reflector_poses
from ur_client import ClientError, UrClient, controller

GOAL = np.array([0.3, -1.2, 1.1, -1.4, -1.3, 0.5])


@pytest.fixture
def place(state, drawn):
    """Where the tool is now; the client's stream would be a period late."""
    return lambda: drawn.tool(state()["commanded_q_rad"], TOOL)


def along(joint, angle):
    return angle * np.eye(6)[joint]


def from_line(points, start, end):
    """``(N,)`` distances from the segment between two points."""
    along = np.clip((points - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1)
    return np.linalg.norm(points - start - along[:, None] * (end - start), axis=1)


def test_a_joint_move_ends_at_its_target_and_the_real_robot_stands_where_drake_says(client, home, state):
    assert client("control", "moveJ", GOAL.tolist(), 1.05, 1.4)
    told = state()
    assert np.allclose(told["commanded_q_rad"], GOAL, atol=1e-12)
    hidden = {"hidden_frame_errors": RealRobot("ur5", 3).hidden_errors}
    assert np.allclose(told["X_ME"], reflector_poses(hidden, GOAL[None])[0], atol=1e-12)


def test_a_joint_move_keeps_to_its_speed_and_all_joints_arrive_together(watched, home):
    joints, speeds, _ = watched("control", "moveJ", GOAL.tolist(), 0.8, 1.4)
    assert np.abs(speeds).max() == pytest.approx(0.8, rel=1e-6)
    share = (joints - home) / (GOAL - home)
    assert np.ptp(share, axis=1).max() < 1e-9


def test_the_tool_of_a_line_stays_on_it(client, watched, home, drawn, place):
    start = drawn.tool(home, TOOL).translation()
    goal = client("receive", "getActualTCPPose")
    goal = [goal[0] + 0.1, goal[1] - 0.15, goal[2] + 0.08, *goal[3:]]
    joints, _, poses = watched("control", "moveL", goal, 0.25, 1.2)
    seen = np.array([drawn.tool(q, TOOL).translation() for q in joints])
    assert len(seen) > 5
    assert from_line(seen, start, np.array(goal[:3])).max() < 1e-8
    assert np.abs(seen - poses[:, :3]).max() < 1e-9
    distance, angle = apart(place(), goal)
    assert distance < 1e-8
    assert angle < 1e-7


def test_a_line_to_joints_and_a_joint_move_to_a_pose_end_there(client, home, drawn, state):
    assert client("control", "moveL_FK", GOAL.tolist(), 0.5, 1.2)
    assert np.allclose(state()["commanded_q_rad"], GOAL, atol=1e-7)
    pose = client("control", "getForwardKinematics", home.tolist(), TOOL)
    assert client("control", "moveJ_IK", pose, 1.0, 1.4)
    assert apart(drawn.tool(state()["commanded_q_rad"], TOOL), pose)[0] < 1e-8


def test_a_path_of_joints_passes_its_corner_within_the_blend_without_stopping(watched, home, drawn, state):
    corner = home + along(0, 0.4)
    end = corner + along(1, 0.3)
    path = [[*corner, 1.0, 1.4, 0.05], [*end, 1.0, 1.4, 0.0]]
    joints, speeds, _ = watched("control", "moveJ", path)
    at_corner = drawn.tool(corner, TOOL).translation()
    seen = np.array([drawn.tool(q, TOOL).translation() for q in joints])
    assert np.linalg.norm(seen - at_corner, axis=1).min() < 0.05
    moving = np.abs(speeds).max(axis=1)
    travelling = np.flatnonzero(moving > 0.05)
    assert (moving[travelling[0] : travelling[-1]] > 0.05).all()
    assert np.allclose(state()["commanded_q_rad"], end, atol=1e-5)  # written with six digits into the script


def test_a_path_of_lines_stays_within_its_blend_and_stops_where_none_is(client, watched, home, place):
    pose = client("receive", "getActualTCPPose")
    corner, end = [*pose], [*pose]
    corner[0] += 0.1
    end[0], end[2] = end[0] + 0.1, end[2] + 0.1
    path = [[*corner, 0.25, 1.2, 0.02], [*end, 0.25, 1.2, 0.0], [*pose, 0.25, 1.2, 0.0]]
    seen = watched("control", "moveL", path)[2][:, :3]
    corners = [np.array(place[:3]) for place in (pose, corner, end, pose)]
    away = np.min([from_line(seen, *pair) for pair in pairwise(corners)], axis=0)
    assert away.max() < 0.02
    assert 1e-5 < np.linalg.norm(seen - corners[1], axis=1).min() < 0.02
    assert np.linalg.norm(place().translation() - corners[3]) < 1e-5


def test_joints_turn_at_the_speed_they_are_told_until_they_are_stopped(client, home, state):
    speeds = [0.02, 0.0, -0.03, 0.0, 0.0, 0.05]
    client("control", "speedJ", speeds, 1.0, 0.5)
    until(lambda: np.allclose(state()["speed_rad_s"], speeds))
    client("control", "speedStop")
    assert np.allclose(state()["speed_rad_s"], 0)


def test_the_tool_drifts_straight_at_the_speed_it_is_told(client, home, place):
    start = client("receive", "getActualTCPPose")
    client.calls(
        [["control", "speedL", [0.0, 0.03, 0.02, 0, 0, 0], 1.0, 0.5], ["sleep", 0.25], ["control", "speedStop"]]
    )
    shift = place().translation() - start[:3]
    assert shift[1] > 0.02
    assert shift[2] == pytest.approx(shift[1] / 1.5, abs=1e-7)
    assert abs(shift[0]) < 1e-7


def test_a_servo_follows_what_it_is_told_500_times_a_second(client, home, state):
    calls, target = [], home.copy()
    for _ in range(150):
        target[5] += 0.002
        calls += [["control", "servoJ", target.tolist(), 0.0, 0.0, 0.002, 0.1, 300.0], ["sleep", 0.002]]
    client.calls(calls)
    until(lambda: np.allclose(state()["commanded_q_rad"], target, atol=1e-5))
    client("control", "servoStop")
    assert client("control", "isSteady")
    assert np.allclose(state()["commanded_q_rad"], target, atol=1e-5)


@pytest.mark.parametrize("stop", ["stopJ", "stopL"])
def test_an_asynchronous_move_is_stopped_on_its_way(client, home, stop, place):
    start = client("receive", "getActualTCPPose")
    goal = [start[0], start[1] - 0.3, start[2], *start[3:]]
    moved, running, _, after, steady = client.calls(
        [
            ["control", "moveL", goal, 0.02, 0.5, True],
            ["sleep", 0.1],
            ["control", "getAsyncOperationProgress"],
            ["control", stop, 1.0],
            ["sleep", 0.05],
            ["control", "getAsyncOperationProgress"],
            ["control", "isSteady"],
        ]
    )
    assert moved is True
    assert running >= 0
    assert after < 0
    assert steady is True
    at = place().translation()
    assert 0.005 < start[1] - at[1] < 0.25
    assert from_line(at[None], np.array(start[:3]), np.array(goal[:3]))[0] < 1e-8


def test_an_asynchronous_move_that_is_left_alone_arrives(client, home, state):
    client("control", "moveJ", GOAL.tolist(), 1.0, 1.4, True)
    for _ in range(100):
        if client.calls([["sleep", 0.02], ["control", "getAsyncOperationProgress"]])[0] < 0:
            break
    assert np.allclose(state()["commanded_q_rad"], GOAL, atol=1e-12)


def test_kinematics_are_those_that_drake_finds_for_the_robot_as_drawn(client, home, drawn):
    for tool in (TOOL, [0.1, 0.0, 0.2, 0.0, 0.5, 0.0]):
        there = client("control", "getForwardKinematics", GOAL.tolist(), tool)
        assert apart(drawn.tool(GOAL, tool), there)[0] < 1e-12
    pose = client("control", "getForwardKinematics", GOAL.tolist(), TOOL)
    assert np.allclose(client("control", "getInverseKinematics", pose, home.tolist()), GOAL, atol=1e-7)
    assert client("control", "getInverseKinematicsHasSolution", pose)
    assert not client("control", "getInverseKinematicsHasSolution", [3.0, 0, 0, 0, 0, 0])
    assert apart(client("control", "getForwardKinematics"), drawn.tool(home, TOOL))[0] < 1e-12


def test_a_pose_that_the_arm_cannot_reach_ends_the_script_and_moves_nothing(client, home, state):
    before = state()["commanded_q_rad"]
    assert client("control", "getInverseKinematics", [3.0, 0, 0, 0, 0, 0]) == []
    assert state()["runtime"] == "stopped"
    assert "no joints" in state()["popup"]
    client.calls([["upload"]])
    assert state()["commanded_q_rad"] == before


def test_a_line_out_of_reach_ends_in_a_protective_stop_inside_of_it(client, home, state):
    goal = client("receive", "getActualTCPPose")
    goal[0] -= 1.5
    assert not client("control", "moveL", goal, 0.5, 1.2)
    assert state()["safety"] == "protective_stop"
    assert np.isfinite(state()["commanded_q_rad"]).all()


def test_tool_and_payload_are_those_the_client_has_set(client, home, state):
    tool = [0.0, 0.01, 0.2, 0.1, 0.0, 0.0]
    client.calls([["control", "setTcp", tool], ["control", "setPayload", 2.5, [0.01, 0.02, 0.03]]])
    assert client("control", "getTCPOffset") == tool
    newer = ["newer", state()["time_s"]]
    kilograms, centre = client.calls([newer, ["receive", "getPayload"], ["receive", "getPayloadCog"]])
    assert (kilograms, centre) == (2.5, [0.01, 0.02, 0.03])
    assert state()["tcp_offset"] == tool


def test_outputs_are_switched_and_the_slider_slows_the_robot_down(client, watched, home, state):
    try:
        client.calls([["io", "setStandardDigitalOut", 3, True], ["io", "setSpeedSlider", 0.25]])
        asked = [["receive", "getActualDigitalOutputBits"], ["receive", "getTargetSpeedFraction"]]
        until(lambda: client.calls(asked) == [1 << 3, 0.25])
        _, speeds, _ = watched("control", "moveJ", (home + along(0, 0.3)).tolist(), 0.8, 3.0)
        assert np.abs(speeds).max() == pytest.approx(0.2, rel=1e-6)
    finally:
        client.calls([["io", "setStandardDigitalOut", 3, False], ["io", "setSpeedSlider", 1.0]])


def test_two_controllers_at_once_do_not_know_of_each_other(quick, client, home):
    other = controller(seed=4, speed_up=SPEED_UP)
    try:
        with UrClient(other.address) as second:
            assert second("control", "moveJ", GOAL.tolist(), 1.05, 1.4)
            assert np.allclose(other.command({"do": "state"})["commanded_q_rad"], GOAL)
            assert np.allclose(quick.command({"do": "state"})["commanded_q_rad"], home)
            assert client("control", "moveJ", (home + 0.1).tolist(), 1.05, 1.4)
            assert np.allclose(other.command({"do": "state"})["commanded_q_rad"], GOAL)
    finally:
        other.close()


def test_a_second_client_cannot_take_control_while_the_first_has_it_and_can_afterwards(quick, client, home):
    with UrClient(quick.address) as second:
        assert len(second("receive", "getActualQ")) == 6
        with pytest.raises(ClientError, match="already in use"):
            second("control", "isConnected")
