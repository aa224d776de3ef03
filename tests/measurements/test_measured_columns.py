"""Which columns a file of measurements may have, in which units, and how each wrong one is told."""

import hashlib

import numpy as np
import pytest
from measured_sheet import JOINTS, POSITION, P, Q, Sheet, place
from scipy.spatial.transform import Rotation

# What is read


def test_the_required_columns_alone_make_a_data_set(read, sheet):
    data = read(sheet)
    np.testing.assert_array_equal(data.q_rad, Q)
    np.testing.assert_allclose(data.p_ME, np.array(P) / 1000, rtol=1e-15)
    assert len(data) == 3
    assert not data.has_orientation
    for name in (
        "R_ME",
        "time_s",
        "temperature_c",
        "payload_kg",
        "approach",
        "pose_id",
        "X_MB_nominal",
        "X_FE_nominal",
    ):
        assert getattr(data, name) is None, name


def test_degrees_and_metres_are_read_by_the_names_of_their_columns(read, sheet):
    same = read(sheet)
    other = Sheet().drop(*JOINTS, *POSITION)
    other.add(**{f"q{i + 1}_deg": [str(np.degrees(row[i])) for row in Q] for i in range(6)})
    other.add(**{f"{axis}_m": [repr(row[i] / 1000) for row in P] for i, axis in enumerate("xyz")})
    data = read(other)
    np.testing.assert_allclose(data.q_rad, same.q_rad, rtol=1e-15)
    np.testing.assert_allclose(data.p_ME, same.p_ME, rtol=1e-15)


def test_the_order_of_the_columns_does_not_matter_and_extra_ones_are_ignored(read, sheet):
    expected = read(sheet)
    sheet.add(operator=["Ann", "", "nan"], step=[7, 8, 9])
    sheet.columns = dict(reversed(sheet.columns.items()))
    data = read(sheet)
    np.testing.assert_array_equal(data.q_rad, expected.q_rad)
    np.testing.assert_array_equal(data.p_ME, expected.p_ME)


def test_orientation_is_read_from_a_scalar_first_quaternion_and_normalised(read, sheet):
    R = Rotation.from_rotvec([[0.1, -0.4, 2.0], [0, 0, 0], [1.0, 1.0, -1.0]])
    x, y, z, w = (R.as_quat() * [[1.0005], [1.0], [0.9995]]).T
    data = read(sheet.add(qw=w, qx=x, qy=y, qz=z))
    assert data.has_orientation
    np.testing.assert_allclose(data.R_ME, R.as_matrix(), atol=1e-14)


def test_the_context_is_read(read, sheet):
    sheet.add(t_s=[0, 4.5, 4.5], temperature_c=[20.5, -1, 22], payload_kg=[0, 1.25, 3])
    sheet.add(**{f"approach{i}": ["-1", "0", "+1"] for i in range(1, 7)})
    data = read(sheet)
    assert data.time_s.tolist() == [0, 4.5, 4.5]
    assert data.temperature_c.tolist() == [20.5, -1, 22]
    assert data.payload_kg.tolist() == [0, 1.25, 3]
    assert data.approach.tolist() == [[-1] * 6, [0] * 6, [1] * 6]


def test_equal_pose_ids_whatever_their_text_are_visits_of_one_pose(read, sheet):
    for name in JOINTS:
        sheet.set(name, 4, sheet.columns[name][0])
    groups = read(sheet.add(pose_id=["left", "right", "left"])).groups()
    assert groups[0] == groups[2] != groups[1]
    assert sorted(set(groups)) == [0, 1]


def test_without_pose_ids_every_row_is_a_pose_of_its_own(read, sheet):
    assert read(sheet).groups().tolist() == [0, 1, 2]


def test_the_data_knows_its_file_its_hash_and_its_lines(read, sheet):
    data = read(sheet)
    assert data.source == "poses.csv"
    assert data.sha256 == hashlib.sha256(sheet.text().encode()).hexdigest()
    assert data.line.tolist() == [2, 3, 4]


def test_a_byte_order_mark_and_blank_lines_at_the_end_are_accepted(read, sheet):
    data = read("\ufeff" + sheet.text() + "\n \n,,,\n")
    np.testing.assert_array_equal(data.q_rad, Q)


def test_as_many_joints_are_read_as_the_robot_has(read, sheet, seven):
    data = read(sheet.add(q7_rad=[0.5, 0.6, 0.7]), seven)
    assert data.q_rad.shape == (3, 7)
    assert data.q_rad[:, 6].tolist() == [0.5, 0.6, 0.7]


# Columns that are wrong


@pytest.mark.parametrize("name", [*JOINTS, *POSITION])
def test_each_required_column_is_missed_by_name(refusal, sheet, name):
    assert place(refusal(sheet.drop(name))) == ("a column is missing", 1, name)


def test_a_misspelt_column_is_recognised(refusal, sheet):
    error = refusal(sheet.rename(q3_rad="Q3_rad"))
    assert place(error) == ("a column is missing", 1, "q3_rad")
    assert "did you mean 'Q3_rad'?" in error.found


def test_a_doubled_column_is_refused(refusal, sheet):
    text = sheet.text().replace("y_mm", "x_mm")
    assert place(refusal(text)) == ("a column appears twice", 1, "x_mm")


@pytest.mark.parametrize(
    ("name", "wrong", "expected"),
    [
        ("q2_rad", "q2_grad", "q2_rad or q2_deg"),
        ("q2_rad", "q2_DEG", "q2_rad or q2_deg"),
        ("y_mm", "y_inch", "y_mm or y_m"),
        ("t_s", "t_ms", "t_s"),
        ("temperature_c", "temperature_f", "temperature_c"),
        ("payload_kg", "payload_lb", "payload_kg"),
    ],
)
def test_an_unknown_unit_is_refused_and_the_known_ones_are_told(refusal, sheet, name, wrong, expected):
    sheet.add(t_s=[1, 2, 3], temperature_c=[20, 20, 20], payload_kg=[0, 0, 0])
    error = refusal(sheet.rename(**{name: wrong}))
    assert place(error) == (f"unknown unit {wrong.split('_')[1]!r}", 1, wrong)
    assert error.expected == expected


@pytest.mark.parametrize(("name", "other", "both"), [("q4_rad", "q4_deg", "rad and deg"), ("z_mm", "z_m", "mm and m")])
def test_units_that_differ_between_columns_are_refused(refusal, sheet, name, other, both):
    error = refusal(sheet.rename(**{name: other}))
    assert error.problem.startswith("the units of ")
    assert error.problem.endswith(" differ")
    assert (error.line, error.found) == (1, both)


def test_a_quantity_in_two_units_is_refused(refusal, sheet):
    error = refusal(sheet.add(x_m=[0.1, 0.2, 0.3]))
    assert place(error) == ("a quantity appears in two units", 1, "x_m")
    assert error.found == "x_mm and x_m"


@pytest.mark.parametrize("name", ["q7_rad", "q0_rad", "q01_rad", "q12_deg", "q" + "9" * 5000 + "_rad"])
def test_a_joint_that_the_robot_does_not_have_is_refused(refusal, sheet, name):
    error = refusal(sheet.add(**{name: [0, 0, 0]}))
    assert place(error) == ("a column for a joint that the robot does not have", 1, name)
    assert error.expected == "q1 to q6"


@pytest.mark.parametrize("missing", ["qw", "qx", "qy", "qz"])
def test_part_of_a_quaternion_is_refused(refusal, sheet, missing):
    sheet.add(qw=[1, 1, 1], qx=[0, 0, 0], qy=[0, 0, 0], qz=[0, 0, 0]).drop(missing)
    assert place(refusal(sheet)) == ("a column is missing", 1, missing)


def test_directions_of_arrival_are_wanted_for_every_joint_or_for_none(refusal, sheet):
    sheet.add(**{f"approach{i}": [1, 1, 1] for i in (1, 2, 3, 4, 6)})
    assert place(refusal(sheet)) == ("a column is missing", 1, "approach5")


def test_an_approach_of_a_joint_that_the_robot_does_not_have_is_refused(refusal, sheet):
    directions = {f"approach{i}": ["1", "0", "-1"] for i in range(1, 8)}
    assert place(refusal(sheet.add(**directions)))[2] == "approach7"
