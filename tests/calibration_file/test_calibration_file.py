"""The calibration file: what is saved comes back to the last bit, for the robot for which it was learnt."""

import json
import os
import re

import numpy as np
import pytest
import truepath
from deviating_arm import EFFECTS, described, measured
from signed_content import changed, signed
from truepath.calibration import load_calibration
from truepath.errors import InputError
from truepath.learn import learn
from truepath.plants import load_robot, models_dir
from truepath.poe import parameter_names


@pytest.fixture(scope="module")
def fit_and_calibration(ur5):
    calibration, fit, _ = learn(ur5, measured(ur5, has_orientation=False), effects=EFFECTS, source="a test")
    return fit, calibration


@pytest.fixture(scope="module")
def calibration(fit_and_calibration):
    return fit_and_calibration[1]


# Saved and loaded


def test_what_was_saved_is_loaded_and_saved_again_to_the_last_byte(calibration, tmp_path):
    path, again = tmp_path / "a.json", tmp_path / "b.json"
    calibration.save(path)
    loaded = load_calibration(path)
    loaded.save(again)
    assert loaded == calibration
    assert again.read_bytes() == path.read_bytes() == calibration.to_json().encode()


@pytest.mark.parametrize("arm", ["ur5 in 3D", "seven joints in 6D"])
def test_a_loaded_calibration_predicts_to_the_last_bit_what_the_fit_did(arm, fit_and_calibration, ur5, seven, tmp_path):
    robot = {"ur5 in 3D": ur5}.get(arm, seven)
    fit, calibration = described(seven, has_orientation=True) if robot is seven else fit_and_calibration
    calibration.save(tmp_path / "c.json")
    model = load_calibration(tmp_path / "c.json", robot).model
    q = np.random.default_rng(1).uniform(-2, 2, (20, robot.num_joints))
    assert model.effects
    for method in ("predict", "predict_nominal", "flange_poses"):
        np.testing.assert_array_equal(getattr(model, method)(q), getattr(fit.model, method)(q), err_msg=method)
    np.testing.assert_array_equal(model.robot.gravity_torque(q), robot.gravity_torque(q))
    for attribute in ("lower_rad", "upper_rad", "velocity_rad_s", "acceleration_rad_s2", "X_WB", "X_BF", "X_BA"):
        np.testing.assert_array_equal(getattr(model.robot, attribute), getattr(robot, attribute), err_msg=attribute)
    assert (model.robot.name, model.robot.joint_names) == (robot.name, robot.joint_names)


def test_the_file_says_of_every_parameter_what_it_is_and_why_it_is_held(fit_and_calibration, text):
    fit, _ = fit_and_calibration
    content = json.loads(text)["parameters"][:36]
    assert [p["name"] for p in content] == [str(name) for name in parameter_names(6)]
    held = [i for i, p in enumerate(content) if p["status"] == "held"]
    assert held == sorted(fit.held)
    assert held
    for i, parameter in enumerate(content):
        assert (parameter["reason"] is not None) == (i in held)
        assert parameter["sigma"] == fit.sigma[i]
        if i in held:
            assert (parameter["value"], parameter["sigma"]) == (0, 0)


def test_the_file_says_where_it_comes_from(text):
    content = json.loads(text)
    assert content["schema"] == "truepath.calibration/1"
    assert {"python", "truepath", "drake", "numpy"} <= set(content["software"])
    assert content["software"]["truepath"] == truepath.__version__  # not what was installed when a checkout was new
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", content["created_utc"])
    assert content["data"]["poses"] == 75
    assert content["data"]["outlier_lines"] == [9, 32]
    assert {effect["name"] for effect in content["effects"]} == {"transmission_error", "joint_compliance"}
    assert re.fullmatch("[0-9a-f]{64}", content["data"]["sha256"])


def test_the_file_is_plain_json_without_nan_and_ends_with_its_checksum(text):
    content = json.loads(text, parse_constant=pytest.fail)
    assert list(content)[-1] == "checksum"
    assert signed(content)["checksum"] == content["checksum"]
    assert text.endswith("}\n")


def test_a_file_that_was_only_formatted_anew_is_still_good(calibration, text, file):
    assert load_calibration(file(json.dumps(json.loads(text)))) == calibration
    assert load_calibration(file(json.dumps(json.loads(text), indent=4, sort_keys=True) + "\n\n")) == calibration


def test_limits_that_a_robot_does_not_have_come_back_as_infinite(text, file):
    content = changed(text, "robot", "upper_rad", [None] * 6)
    assert np.isposinf(load_calibration(file(content)).model.robot.upper_rad).all()


# The right robot


def test_the_robot_for_which_it_was_learnt_is_accepted_wherever_it_stands(text, file, ur5):
    load_calibration(file(text), ur5)
    load_calibration(file(text), load_robot(models_dir() / "ur5" / "cell.dmd.yaml"))


@pytest.mark.parametrize("other", ["ur10", "seven"])
def test_another_robot_is_refused_and_both_are_named(text, refusal, request, other):
    error = refusal(text, request.getfixturevalue(other))
    assert error.problem == "the calibration belongs to another robot"
    assert other in error.expected
    assert "ur5" in error.found


# Saving


def test_saving_replaces_an_old_file_and_leaves_nothing_beside_it(calibration, text, file):
    path = file("old")
    calibration.save(path)
    assert path.read_text() == text
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_saving_that_fails_leaves_the_old_calibration_in_force(calibration, text, file, monkeypatch):
    path = file(text)
    other = calibration.model_copy(update={"created_utc": "2000-01-01T00:00:00+00:00"})

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="No space left"):
        other.save(path)
    assert load_calibration(path) == calibration
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_a_calibration_with_a_number_that_is_not_finite_cannot_be_saved(calibration, text, file):
    path = file(text)
    noise = calibration.noise.model_copy(update={"position_mm": float("nan")})
    with pytest.raises(ValueError, match="JSON compliant"):
        calibration.model_copy(update={"noise": noise}).save(path)
    assert load_calibration(path) == calibration
