"""Angles far beyond the joint limits are refused, and degrees among radians are recognised."""

from dataclasses import replace

import numpy as np
import pytest
from measured_sheet import JOINTS, Q, place
from truepath.errors import InputError
from truepath.measurements import Measurements, check_joint_limits


def data_at(q):
    return Measurements(q_rad=np.atleast_2d(q), p_ME=np.zeros((len(np.atleast_2d(q)), 3)))


def test_two_degrees_beyond_a_limit_are_tolerated_and_no_more(seven):
    check_joint_limits(data_at(seven.upper_rad + np.radians(1.99)), seven, "f")
    check_joint_limits(data_at(seven.lower_rad - np.radians(1.99)), seven, "f")
    q = np.zeros((3, 7))
    q[2, 3] = seven.upper_rad[3] + np.radians(2.01)
    with pytest.raises(InputError) as caught:
        check_joint_limits(data_at(q), seven, "poses.csv")
    error = caught.value
    assert place(error) == ("an angle lies far beyond the joint limits", 4, "q4 (joint4)")
    assert error.expected == "-2.2000 to 2.3000 rad"
    assert error.found == f"{q[2, 3]:.4f} rad"


def test_degrees_in_a_column_of_radians_are_recognised(refusal, sheet):
    for i, name in enumerate(JOINTS):
        sheet.columns[name] = [str(np.degrees(row[i])) for row in Q]
    error = refusal(sheet)
    assert error.problem == "an angle lies far beyond the joint limits"
    assert (error.line, error.column) == (2, "q2 (shoulder_lift_joint)")
    assert "were degrees written into a column of radians?" in error.found


def test_an_angle_that_would_be_too_large_in_degrees_too_gets_no_such_hint(refusal, sheet):
    for i, name in enumerate(JOINTS):
        sheet.columns[name] = [str(np.degrees(row[i])) for row in Q]
    error = refusal(sheet.set("q1_rad", 2, "500"))
    assert (error.line, error.column) == (2, "q1 (shoulder_pan_joint)")
    assert error.found == "500.0000 rad"


def test_a_single_angle_beyond_its_limits_is_a_slip_and_not_taken_for_degrees(refusal, sheet):
    error = refusal(sheet.set("q5_rad", 3, "15"))
    assert (error.line, error.column) == (3, "q5 (wrist_2_joint)")
    assert error.found == "15.0000 rad"


def test_a_joint_without_limits_may_be_anywhere(seven):
    free = replace(seven, lower_rad=np.full(7, -np.inf), upper_rad=np.full(7, np.inf))
    check_joint_limits(data_at(np.full(7, 1000.0)), free, "f")


def test_data_of_a_robot_with_another_number_of_joints_is_refused(ur5):
    with pytest.raises(InputError, match="the data has 7 joints"):
        check_joint_limits(data_at(np.zeros(7)), ur5, "poses.csv")
