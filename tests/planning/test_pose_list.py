"""The file of poses: what is written is read back, what is doubtful is refused with its line."""

import numpy as np
import pytest
from truepath.errors import InputError
from truepath.planning.pose_list import PoseList, read_pose_list, robot_mark, to_csv
from truepath.plants import load_robot

JOINTS = ",".join(f"q{i}_rad" for i in range(1, 7))


def read(tmp_path, text):
    path = tmp_path / "poses.csv"
    path.write_text(text)
    return read_pose_list(path)


def row(*joints):
    return ",".join(str(angle) for angle in (*joints, *[0.0] * (6 - len(joints))))


def test_a_list_comes_back_as_it_was_written(tmp_path):
    q = np.random.default_rng(0).uniform(-6, 6, (5, 6))
    q[4] = q[0]
    poses = PoseList(q, np.array([True, False, True, True, True]), np.array([0, -1, 7, 3, 0]))
    again = read(tmp_path, to_csv(poses))
    np.testing.assert_allclose(again.q_rad, q, atol=1e-9)
    np.testing.assert_array_equal(again.measure, poses.measure)
    np.testing.assert_array_equal(again.pose_id, poses.pose_id)


def test_the_header_is_the_contract_and_a_via_row_has_no_number():
    text = to_csv(PoseList(np.zeros((2, 6)), np.array([False, True]), np.array([-1, 4])))
    header, via, stop = text.splitlines()
    assert header == "pose_id,measure," + JOINTS
    assert via.startswith(",0,0.0")
    assert stop.startswith("4,1,0.0")


def test_degrees_are_understood(tmp_path):
    poses = read(tmp_path, "measure,q1_deg,q2_deg\n1,180,-90\n")
    np.testing.assert_allclose(poses.q_rad, [[np.pi, -np.pi / 2]])


def test_joints_alone_are_poses_that_are_all_measured_each_its_own(tmp_path):
    poses = read(tmp_path, f"{JOINTS}\n{row(1)}\n{row(2)}\n{row(1)}\n")
    assert poses.measure.all()
    assert poses.pose_id.tolist() == [0, 1, 2]


def test_without_numbers_only_measured_rows_get_one(tmp_path):
    poses = read(tmp_path, f"measure,{JOINTS}\n1,{row(1)}\n0,{row(2)}\n1,{row(3)}\n")
    assert poses.pose_id.tolist() == [0, -1, 1]


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [
        (f"measure,{JOINTS}\n1,{row()}\nyes,{row()}\n", 3, "measure"),
        (f"measure,{JOINTS}\n,{row()}\n", 2, "measure"),
        (f"pose_id,{JOINTS}\n1,{row()}\n1.5,{row()}\n", 3, "pose_id"),
        (f"pose_id,{JOINTS}\n-2,{row()}\n", 2, "pose_id"),
        (f"pose_id,{JOINTS}\n,{row()}\n", 2, "pose_id"),
        (f"pose_id,measure,{JOINTS}\n0,1,{row()}\n1,0,{row()}\n", 3, "pose_id"),
        (f"pose_id,{JOINTS}\n5,{row(1)}\n6,{row(1)}\n5,{row(1.1)}\n", 4, "pose_id"),
        (f"pose_id,{JOINTS}\n5,{row('nan')}\n", 2, "q1_rad"),
        (f"mesure,{JOINTS}\n0,{row()}\n", 1, "mesure"),
        ("q1_rad,q3_rad\n0,0\n", 1, "q2_rad"),
        ("q1_rad,q2_deg\n0,0\n", 1, None),
        ("pose_id,measure\n0,1\n", 1, "q1_rad"),
    ],
)
def test_a_fault_is_told_with_its_place(tmp_path, text, line, column):
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    assert error.value.line == line
    assert error.value.column == column
    assert error.value.expected or error.value.found


def test_a_list_in_which_nothing_is_measured_is_refused(tmp_path):
    with pytest.raises(InputError, match="nothing is to be measured"):
        read(tmp_path, f"measure,{JOINTS}\n0,{row()}\n")


def test_the_robot_that_was_planned_for_comes_back():
    mark = robot_mark(load_robot("ur5"))
    assert mark.startswith("ur5:")
    assert mark != robot_mark(load_robot("ur10"))
    text = to_csv(PoseList(np.zeros((2, 6)), np.array([False, True]), np.array([-1, 4]), mark))
    assert text.splitlines()[0] == "pose_id,measure," + JOINTS + ",robot"


def test_the_robot_is_read_and_must_be_one(tmp_path):
    mark = "ur5:0123456789ab"
    assert read(tmp_path, f"{JOINTS},robot\n{row()},{mark}\n{row(1)},{mark}\n").robot == mark
    with pytest.raises(InputError, match="two robots"):
        read(tmp_path, f"{JOINTS},robot\n{row()},{mark}\n{row(1)},ur10:0123456789ab\n")
    with pytest.raises(InputError, match="names no robot"):
        read(tmp_path, f"{JOINTS},robot\n{row()},\n")
