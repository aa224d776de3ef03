"""Toolpath files: what is read, what is kept to the letter, and how faults are told."""

import csv

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truepath.errors import InputError
from truepath.programs.toolpath_csv import read_toolpath

JOINTS = ",".join(f"q{i}_rad" for i in range(1, 7))
ROW = "0.1,-1.2,1.3,-1.4,-1.5,0.6"
Q = [0.1, -1.2, 1.3, -1.4, -1.5, 0.6]


@pytest.fixture
def write(tmp_path):
    def write(content):
        path = tmp_path / "path.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.fixture
def read(write):
    return lambda content, joints=6: read_toolpath(write(content), joints)


@pytest.fixture
def refusal(read):
    def refusal(content) -> InputError:
        with pytest.raises(InputError) as caught:
            read(content)
        assert "path.csv" in str(caught.value)
        return caught.value

    return refusal


def cells(text):
    return list(csv.reader(text.splitlines()))


# What is read


def test_joints_in_radians_are_read_in_the_order_of_their_numbers(read):
    path = read("q2_rad,q1_rad,q3_rad,q6_rad,q5_rad,q4_rad\n-1.2,0.1,1.3,0.6,-1.5,-1.4\n")
    assert path.q_rad == pytest.approx(np.array([Q]))
    assert path.X_BF is None


def test_joints_in_degrees_are_read_as_such(read):
    path = read(f"{JOINTS.replace('rad', 'deg')}\n90,-45,30,0,180,-270\n")
    assert path.q_rad == pytest.approx(np.radians([[90, -45, 30, 0, 180, -270]]))


@pytest.mark.parametrize(("unit", "row"), [("mm", "100,-200,300"), ("m", "0.1,-0.2,0.3")])
def test_flange_poses_are_read_in_mm_or_m(read, unit, row):
    path = read(f"x_{unit},y_{unit},z_{unit},qw,qx,qy,qz\n{row},0.5,0.5,0.5,-0.5\n")
    assert path.q_rad is None
    assert path.X_BF[0, :3, 3] == pytest.approx([0.1, -0.2, 0.3])
    expected = Rotation.from_quat([0.5, 0.5, -0.5, 0.5]).as_matrix()  # scalar last
    assert path.X_BF[0, :3, :3] == pytest.approx(expected)


def test_with_joints_and_poses_the_joints_count(read):
    path = read(f"{JOINTS},x_mm,y_mm,z_mm,qw,qx,qy,qz\n{ROW},not,even,numbers,0,0,0,0\n")
    assert path.q_rad == pytest.approx(np.array([Q]))
    assert path.X_BF is None


def test_a_path_for_seven_joints_is_read_for_seven_joints(read):
    path = read(f"{JOINTS},q7_rad\n{ROW},0.7\n", joints=7)
    assert path.q_rad == pytest.approx(np.array([[*Q, 0.7]]))


# What is written


def test_corrected_joints_replace_the_programmed_ones_and_nothing_else(read):
    path = read(f'label,{JOINTS},speed_mm_s,note\nP1,{ROW},250,"a, ""b"""\nP2,{ROW},  30.0 ,\n')
    corrected = np.arange(12.0).reshape(2, 6) / 7
    header, *rows = cells(path.with_joints(corrected))
    assert header == ["label", *JOINTS.split(","), "speed_mm_s", "note"]
    assert [row[0] for row in rows] == ["P1", "P2"]
    assert [row[7:] for row in rows] == [["250", 'a, "b"'], ["  30.0 ", ""]]
    assert np.array([row[1:7] for row in rows], float) == pytest.approx(corrected, abs=1e-12)


def test_the_order_of_rows_and_columns_is_kept(read):
    lines = [f"{k},{k / 100},{ROW[4:]}" for k in (5, 3, 9, 1)]
    path = read("\n".join([f"id,{JOINTS}", *lines]) + "\n")
    rows = cells(path.with_joints(path.q_rad))[1:]
    assert [row[0] for row in rows] == ["5", "3", "9", "1"]
    assert [float(row[1]) for row in rows] == [0.05, 0.03, 0.09, 0.01]


def test_joint_columns_in_any_order_get_their_own_values_back(read):
    path = read("q2_rad,tag,q1_rad,q3_rad,q6_rad,q5_rad,q4_rad\n-1.2,x,0.1,1.3,0.6,-1.5,-1.4\n")
    header, row = cells(path.with_joints(np.array([[1.0, 2, 3, 4, 5, 6]])))
    assert dict(zip(header, row, strict=True))["tag"] == "x"
    assert [float(row[header.index(f"q{i}_rad")]) for i in range(1, 7)] == [1, 2, 3, 4, 5, 6]


def test_degrees_are_written_as_degrees_to_a_nanodegree(read):
    path = read(f"{JOINTS.replace('rad', 'deg')}\n90,-45,30,0,180,-270\n")
    row = cells(path.with_joints(np.radians([[1.123456789012, -2, 3, -4, 5, 6]])))[1]
    assert np.array(row, float) == pytest.approx([1.123456789012, -2, 3, -4, 5, 6], abs=1e-10)


def test_a_path_of_poses_gets_joint_columns_behind_its_own(read):
    path = read("tag,x_mm,y_mm,z_mm,qw,qx,qy,qz\na,100,-200,300,1,0,0,0\n")
    header, row = cells(path.with_joints(np.array([Q])))
    assert header == ["tag", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", *JOINTS.split(",")]
    assert row[:8] == ["a", "100", "-200", "300", "1", "0", "0", "0"]
    assert np.array(row[8:], float) == pytest.approx(Q)


def test_what_was_written_reads_back_to_a_picoradian(read, write):
    path = read(f"{JOINTS}\n{ROW}\n")
    corrected = np.random.default_rng(0).uniform(-6, 6, (1, 6))
    again = read_toolpath(write(path.with_joints(corrected)), 6)
    assert np.abs(again.q_rad - corrected).max() < 1e-12


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_line_ends_are_kept(read, end):
    text = read(f"{JOINTS}{end}{ROW}{end}{ROW}{end}").with_joints(np.array([Q, Q]))
    assert text.count(end) == 3
    assert text.count("\n") == 3
    assert text.endswith(end)


def test_a_byte_order_mark_is_kept(read):
    path = read(b"\xef\xbb\xbf" + f"{JOINTS},note\n{ROW},schweißen\n".encode())
    assert path.with_joints(path.q_rad).encode().startswith(b"\xef\xbb\xbfq1_rad")
    assert "schweißen" in path.with_joints(path.q_rad)


def test_a_file_without_a_line_end_at_its_end_loses_no_row(read):
    path = read(f"{JOINTS}\n{ROW}\n{ROW}")
    assert len(cells(path.with_joints(path.q_rad))) == 3


# Faults


def test_a_file_with_neither_joints_nor_poses_is_no_toolpath(refusal):
    error = refusal("a,b\n1,2\n")
    assert error.problem == "this is no toolpath"
    assert "q1_rad ... q6_rad" in error.expected
    assert error.found == "a, b"


def test_a_missing_joint_is_named(refusal):
    assert refusal(f"{JOINTS[:-7]}\n{ROW[:-4]}\n").column == "q6_rad"


def test_a_joint_that_the_robot_does_not_have_is_refused(refusal):
    """The path is one for another robot; what its seventh joint does cannot be left out."""
    error = refusal(f"{JOINTS},q7_rad\n{ROW},0.7\n")
    assert (error.line, error.column) == (1, "q7_rad")
    assert error.expected == "q1 to q6"


def test_two_units_are_refused(refusal):
    assert "units" in refusal(f"{JOINTS.replace('q3_rad', 'q3_deg')}\n{ROW}\n").problem
    assert refusal(f"{JOINTS},q3_deg\n{ROW},1\n").problem == "a quantity appears in two units"


def test_poses_without_orientation_are_refused(refusal):
    assert refusal("x_mm,y_mm,z_mm\n1,2,3\n").column == "qw"


def test_a_quaternion_that_is_not_of_unit_length_is_refused_with_its_line(refusal):
    error = refusal("x_mm,y_mm,z_mm,qw,qx,qy,qz\n1,2,3,1,0,0,0\n1,2,3,1,0.2,0,0\n")
    assert (error.problem, error.line) == ("the quaternion is not of unit length", 3)


@pytest.mark.parametrize("cell", ["", "abc", "nan", "inf", "1_0", "0;5"])
def test_a_cell_that_is_no_number_is_refused_with_line_and_column(refusal, cell):
    error = refusal(f"tag,{JOINTS}\nP1,{ROW}\nP2,0.1,{cell},1.3,-1.4,-1.5,0.6\n")
    assert (error.line, error.column) == (3, "q2_rad")


def test_a_row_that_is_too_short_is_refused_with_its_line(refusal):
    assert refusal(f"{JOINTS}\n{ROW}\n0.1,0.2\n").line == 3


def test_a_header_alone_is_refused(refusal):
    assert "no rows" in refusal(f"{JOINTS}\n").problem
