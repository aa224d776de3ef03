"""A ``calibration.conf`` of a controller is read as deltas to the published parameters, or refused with its line."""

import contextlib

import numpy as np
import pytest
from denavit_hartenberg import askew, calibration_conf, flange_poses, table
from hypothesis import given
from hypothesis import strategies as st
from published_arms import MODELS, X_0T, joints, written
from truepath.controller import controller_of
from truepath.controller_files import read_calibration_conf
from truepath.errors import InputError
from truepath.plants import load_robot


@pytest.mark.parametrize("name", MODELS)
def test_deltas_are_added_to_the_published_parameters(tmp_path, name):
    rows = table(MODELS[name]) + np.random.default_rng(1).normal(scale=1e-3, size=(6, 4))
    controller = controller_of(
        load_robot(name), written(tmp_path / "calibration.conf", calibration_conf(MODELS[name], rows))
    )
    assert np.abs(controller.tool_poses(joints(), X_0T) - flange_poses(rows, joints()) @ X_0T).max() < 1e-12
    assert controller.source == f"{MODELS[name]} as calibrated in calibration.conf"


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_lengths_of_metres_that_cancel_are_no_fault(tmp_path, name, seed):
    arm, rows = askew(MODELS[name], seed)
    assert np.abs(rows[:, 2]).max() > 1.5  # metres, for a tilt of some milliradians
    controller = controller_of(
        load_robot(name), written(tmp_path / "calibration.conf", calibration_conf(MODELS[name], rows))
    )
    assert np.abs(controller.tool_poses(joints(), np.eye(4)) - arm(joints())).max() < 1e-10
    assert np.abs(controller.kinematics.X_BA[:, :3, 3]).max() < 1.5
    assert np.abs(controller.kinematics.X_BA[:, :3, 3] - load_robot(name).X_BA[:, :3, 3]).max() < 0.02


def test_the_file_of_another_size_of_arm_is_refused_and_its_size_named(ur5, tmp_path):
    path = written(tmp_path / "calibration.conf", calibration_conf("UR10", askew("UR10", 2)[1]))
    with pytest.raises(InputError, match="does not fit the robot") as caught:
        controller_of(ur5, path)
    assert caught.value.file == path
    assert "UR5" in caught.value.expected
    assert "UR10" in caught.value.found


GOOD_CONF = calibration_conf("UR5", table("UR5") + 1e-4)


@pytest.mark.parametrize(
    ("old", "new", "problem", "line"),
    [
        ("[mounting]", "[moving]", "section is missing", None),
        ("[mounting]\n", "", "no calibration.conf", 1),
        ("delta_d = [", "delta_e = [", "entry is missing", None),
        ("delta_a = [ ", "delta_a = [ 0, ", "six numbers", 3),
        ("delta_a = [ ", "delta_a = ", "six numbers", 3),
        ("delta_a = [ ", "delta_a = [ __import__('os').getcwd() + ", "not a number", 3),
        ("delta_d = [ ", "delta_d = [ nan #", "six numbers", 4),
        ("delta_d = [ ", "delta_d = [ 1", "does not fit", None),
        ("delta_alpha = [ ", "delta_alpha = [ 1_", "not a number", 5),
        ("delta_alpha = [ ", "delta_alpha = [ 1e9 #", "six numbers", 5),
        ("delta_theta = [ ", "delta_theta = [ 99999", "beyond all reason", 2),
        ("delta_alpha = [ ", "delta_theta = [ ", "no calibration.conf", 5),
        ("calibration_status = 2", "calibration_status = 0", "not calibrated", 7),
        ("calibration_status = 2", "calibration_status = 7", "unknown calibration status", 7),
        ("delta_theta", "\x00", "entry is missing", None),
    ],
)
def test_a_bad_conf_is_refused_with_its_line(ur5, tmp_path, old, new, problem, line):
    assert old in GOOD_CONF
    path = written(tmp_path / "calibration.conf", GOOD_CONF.replace(old, new, 1))
    with pytest.raises(InputError, match=problem) as caught:
        controller_of(ur5, path)
    assert (caught.value.file, caught.value.line) == (path, line)


def test_a_file_of_zeros_that_says_not_calibrated_is_the_published_arm(ur5, tmp_path):
    text = calibration_conf("UR5", table("UR5")).replace("status = 2", "status = 0")
    controller = controller_of(ur5, written(tmp_path / "calibration.conf", text))
    assert np.array_equal(controller.kinematics.X_BF, controller_of(ur5).kinematics.X_BF)


@given(data=st.data())
def test_no_spoilt_conf_does_anything_but_be_read_or_refused(data, spoilt, tmp_path_factory):
    path = tmp_path_factory.mktemp("spoilt") / "calibration.conf"
    path.write_bytes(data.draw(spoilt(GOOD_CONF.encode())))
    with contextlib.suppress(InputError):
        assert np.isfinite(read_calibration_conf(path)).all()
