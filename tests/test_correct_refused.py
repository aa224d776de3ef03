"""A correction that is too large, leaps, or passes a limit is refused with its line; what is doubtful is told."""

import json
from dataclasses import replace

import numpy as np
import pytest
from smooth_path import measured, smooth_path
from truepath.calibrate import calibrate
from truepath.correct import correct
from truepath.errors import CorrectionError, InputError
from truepath.model import nominal_model
from truepath.region import cover
from truepath.virtual.real_robot import RealRobot

ELBOW_4_POS = 3 * 4  # number of axis4.pos_x


@pytest.fixture(scope="module")
def registered():
    """A calibration for which nobody stated where robot and reflector are meant to be."""
    real = RealRobot("ur5", 0)
    return calibrate(real.robot, measured(real)).model


@pytest.fixture(scope="module")
def path():
    return smooth_path()


def refusal(model, q, **options) -> CorrectionError:
    with pytest.raises(CorrectionError) as caught:
        correct(model, q, line=np.arange(len(q)) + 2, file="path.csv", **options)
    assert f"path.csv, line {caught.value.line}" in str(caught.value)
    return caught.value


# What is refused, with the line concerned


def test_a_program_beyond_a_joint_limit_is_refused(registered, path):
    q = path.copy()
    q[40:, 0] = 2 * np.pi + 1e-3
    error = refusal(registered, q)
    assert error.problem == "the program itself passes a joint limit"
    assert (error.line, error.column) == (42, "q1 (shoulder_pan_joint)")
    assert error.found == "6.284185 rad"


def test_a_correction_that_would_pass_a_limit_is_refused(registered, path):
    change = (correct(registered, path).q_rad - path)[:, 0]  # does not depend on joint 1 itself
    first = int(np.argmax(np.abs(change)))
    q = path.copy()
    q[:, 0] = np.sign(change[first]) * (2 * np.pi - 0.5 * abs(change[first]))
    error = refusal(registered, q)
    assert error.problem == "the corrected joint passes its limit"
    assert error.column == "q1 (shoulder_pan_joint)"
    assert error.line == 2 + int(np.argmax(change * np.sign(change[first]) > 0.5 * abs(change[first])))


def test_too_large_a_correction_is_refused_where_it_first_is_too_large(registered, path):
    displacement = correct(registered, path).displacement_mm
    bound = 0.5 * (displacement.min() + displacement.max())
    error = refusal(registered, path, max_correction_mm=bound)
    assert error.problem == "the correction is larger than allowed"
    assert error.line == 2 + int(np.argmax(displacement > bound))
    assert "--max-correction-mm" in error.expected


@pytest.mark.parametrize("bound", [float("nan"), -1.0, 0.0])
def test_a_bound_that_is_no_bound_lets_nothing_pass(registered, path, bound):
    assert refusal(registered, path, max_correction_mm=bound).line == 2


def test_five_millimetres_is_the_bound_unless_stated_otherwise(registered, path):
    sloppy = replace(registered, p=10 * registered.p)
    assert "5 mm at most" in refusal(sloppy, path).expected
    assert correct(sloppy, path, max_correction_mm=50.0).displacement_mm.max() > 5.0


def test_a_path_through_a_wrist_singularity_is_refused_where_it_gets_too_close(registered, path):
    q = path.copy()
    q[:, 4] = (np.arange(100) - 50) / 100  # through zero in line 52
    error = refusal(registered, q)
    assert error.problem == "the correction leaves the posture"
    assert abs(q[error.line - 2, 4]) < 0.03
    assert "distance to singularity" in error.found


def test_a_pose_that_the_real_arm_cannot_reach_is_refused(ur5, path):
    """With the elbow stretched out the flange is at full reach, which is a millimetre too far for a shorter arm."""
    stretched = path[:5].copy()
    stretched[:, 2], stretched[:, 3] = 0.0, np.pi / 2
    problems = set()
    for index in (ELBOW_4_POS, ELBOW_4_POS + 1):
        for shift in (1e-3, -1e-3):
            p = np.zeros(36)
            p[index] = shift
            try:
                correct(replace(nominal_model(ur5), p=p), stretched, line=np.arange(5) + 2)
            except CorrectionError as error:
                problems.add((error.problem, error.line))
    assert ("no correction was found near the programmed joints", 2) in problems


def test_a_correction_that_jumps_is_refused_at_the_waypoint_behind_the_jump(registered, path):
    """The elbow passes through its stretched pose: the correction of the shoulder leaps there."""
    q = path.copy()
    q[:, 2] = np.linspace(0.3, -0.3, 100)
    error = refusal(registered, q)
    assert error.problem in (
        "the correction jumps between neighbouring waypoints",
        "no correction was found near the programmed joints",
        "the correction leaves the posture",
    )
    assert abs(q[error.line - 2, 2]) < 0.02


def test_a_jump_of_the_program_itself_is_the_programs_own(registered, path):
    q = path.copy()
    q[50:, 0] += 1.0
    corrected = correct(registered, q)
    assert np.abs(corrected.q_rad - q).max() < 0.02


def test_no_numbers_no_waypoints_and_other_robots_are_refused(registered, path):
    q = path.copy()
    q[7, 2] = np.nan
    assert refusal(registered, q).line == 9
    with pytest.raises(InputError, match="no waypoints"):
        correct(registered, np.zeros((0, 6)))
    with pytest.raises(InputError, match="another number of joints"):
        correct(registered, path[:, :5])


# What is reported


def test_waypoints_outside_the_measured_joints_are_counted_and_the_first_is_named(registered, path):
    region = cover(path[20:60] + np.random.default_rng(0).normal(scale=0.001, size=(40, 6)))
    corrected = correct(registered, path, region=region, line=np.arange(100) + 2)
    assert corrected.outside[:10].all()
    assert not corrected.outside[25:55].any()
    assert any("outside the joints that were measured (first in line 2)" in text for text in corrected.warnings)
    assert corrected.summary()["outside_calibrated_region"] == corrected.outside.sum()


def test_waypoints_near_a_singularity_are_warned_of(registered, path):
    q = path.copy()
    q[:, 4] = 0.05
    corrected = correct(registered, q, line=np.arange(100) + 2)
    assert any("close to a singularity (first in line 2" in text for text in corrected.warnings)


def test_the_summary_is_plain_json(registered, path):
    summary = json.loads(json.dumps(correct(registered, path).summary(), allow_nan=False))
    assert summary["schema"] == "truepath.correction/1"
    assert summary["waypoints"] == 100
    assert summary["predicted_error_before_mm"]["mean"] > 0.1
    assert summary["predicted_error_after_mm"]["max"] < 1e-3
