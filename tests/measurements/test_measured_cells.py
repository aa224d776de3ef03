"""Each wrong cell of a file of measurements is told with its place."""

import pytest
from measured_sheet import place

CONTEXT = {"t_s": [1, 2, 3], "temperature_c": [20, 21, 22], "payload_kg": [0, 1, 2]}
QUATERNION = {"qw": [1, 1, 1], "qx": [0, 0, 0], "qy": [0, 0, 0], "qz": [0, 0, 0]}
APPROACH = {f"approach{i}": [1, 0, -1] for i in range(1, 7)}


@pytest.mark.parametrize("name", ["q1_rad", "q6_rad", "z_mm", "qy", "t_s", "temperature_c", "payload_kg", "approach4"])
@pytest.mark.parametrize(
    ("cell", "problem"),
    [
        ("", "a number is missing"),
        ("zero", "text where a number belongs"),
        ("1_000", "text where a number belongs"),
        ("NaN", "not a number (NaN)"),
        ("inf", "an infinite number"),
        ('"1,5"', "a decimal comma where a decimal point belongs"),
    ],
)
def test_in_every_column_a_cell_that_is_no_number_is_told_with_its_place(refusal, sheet, name, cell, problem):
    sheet.add(**CONTEXT, **QUATERNION, **APPROACH).set(name, 3, cell)
    assert place(refusal(sheet)) == (problem, 3, name)


def test_a_decimal_comma_without_quotes_makes_a_ragged_row(refusal, sheet):
    error = refusal(sheet.text().replace("110.5", "110,5"))
    assert (error.problem, error.line) == ("a row has too many or too few cells", 3)


@pytest.mark.parametrize(("w", "length"), [(1.002, "1.002000"), (0.998, "0.998000"), (0, "0.000000"), (2, "2.000000")])
def test_a_quaternion_that_is_not_of_unit_length_is_refused(refusal, sheet, w, length):
    error = refusal(sheet.add(**QUATERNION).set("qw", 4, str(w)))
    assert place(error) == ("the quaternion is not of unit length", 4, "qw, qx, qy, qz")
    assert error.found == length


@pytest.mark.parametrize("cell", ["2", "-2", "0.5", "1e-3"])
def test_a_direction_of_arrival_is_minus_one_zero_or_one(refusal, sheet, cell):
    error = refusal(sheet.add(**APPROACH).set("approach5", 3, cell))
    assert place(error) == ("not a direction of arrival", 3, "approach5")
    assert (error.expected, error.found) == ("-1, 0 or 1", cell)


def test_time_never_runs_backwards(refusal, sheet):
    error = refusal(sheet.add(t_s=[5, 7.5, 7.25]))
    assert place(error) == ("time runs backwards", 4, "t_s")
    assert "7.5 or later" in error.expected
    assert error.found == "7.25"


def test_a_pose_without_its_id_is_refused_and_not_put_into_one_group_with_its_like(refusal, sheet):
    error = refusal(sheet.add(pose_id=["a", "", " "]))
    assert place(error) == ("the name of a pose is missing", 3, "pose_id")


def test_a_position_that_no_tracker_reaches_is_refused(refusal, sheet):
    error = refusal(sheet.set("x_mm", 3, "1e300"))
    assert place(error) == ("no tracker measures so far", 3, "x_mm")


def test_one_pose_id_for_different_joints_is_refused(refusal, sheet):
    error = refusal(sheet.add(pose_id=["left", "right", "left"]))
    assert place(error) == ("one pose_id stands for different poses", 4, "pose_id")
    assert "line 2" in error.expected


def test_a_negative_payload_is_refused(refusal, sheet):
    error = refusal(sheet.add(payload_kg=["0", "1.5", "-0.1"]))
    assert place(error) == ("a payload cannot be negative", 4, "payload_kg")
