"""From measurements to a calibration file: what it says about itself must be true on poses nobody has seen."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest
from truepath.calibration import load_calibration
from truepath.learn import learn
from truepath.readers import read_measurements
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure, to_csv

POSES = 200
OUTLIERS = [3, 40, 41, 150]


@pytest.fixture(scope="module")
def real():
    return RealRobot("ur5", 11)


@pytest.fixture(scope="module")
def joints(real):
    return free_poses(real, POSES + 200, np.random.default_rng(11))


@pytest.fixture(scope="module")
def data(real, joints):
    """200 poses in the world's frame, four of them wrong by 5 mm."""
    clean = measure(real, joints[:POSES], Campaign())
    p_ME = clean.p_ME.copy()
    p_ME[OUTLIERS] += 0.005
    return replace(clean, p_ME=p_ME, X_MB_nominal=real.robot.X_WB, X_FE_nominal=real.robot.X_FR)


@pytest.fixture(scope="module")
def told():
    """What ``learn`` says while it works."""
    return []


@pytest.fixture(scope="module")
def learnt(real, data, told):
    """Calibration and fit."""
    return learn(real.robot, data, source="ur5_cell", progress=told.append)[:2]


@pytest.fixture(scope="module")
def calibration(learnt):
    return learnt[0]


def test_the_accuracy_stated_for_new_poses_is_the_one_they_turn_out_to_have(real, joints, calibration):
    fresh = measure(real, joints[POSES:], Campaign(seed=5))
    for stated, predict in (
        (calibration.heldout.calibrated, calibration.model.predict),
        (calibration.heldout.nominal, calibration.model.predict_nominal),
    ):
        found = 1e3 * np.linalg.norm(predict(fresh.q_rad)[:, :3, 3] - fresh.p_ME, axis=1)
        assert stated.position_mm.mean == pytest.approx(found.mean(), rel=0.1)
        assert stated.position_mm.rms == pytest.approx(np.sqrt(np.mean(found**2)), rel=0.1)


def test_the_calibrated_robot_is_better_by_far(calibration):
    assert calibration.heldout.nominal.position_mm.mean > 1.0
    assert calibration.heldout.calibrated.position_mm.mean < 0.04


def test_outliers_are_named_by_their_lines_and_left_out_of_everything(real, data, calibration):
    assert calibration.data.outlier_lines == [row + 2 for row in OUTLIERS]  # the header is line 1
    assert calibration.data.poses == POSES
    assert calibration.heldout.calibrated.position_mm.max < 0.2
    kept = np.delete(data.q_rad, OUTLIERS, axis=0)
    assert np.allclose(calibration.region.lower_rad, kept.min(axis=0))
    assert np.allclose(calibration.region.upper_rad, kept.max(axis=0))
    assert calibration.region.region().contains(kept).all()


def test_the_file_holds_what_the_fit_found(learnt):
    calibration, fit = learnt
    by_name = {parameter.name: parameter for parameter in calibration.parameters}
    for index, name in enumerate(fit.names):
        parameter = by_name[str(name)]
        assert parameter.value == fit.model.p[index]
        assert parameter.sigma == fit.sigma[index]
        assert (parameter.status, parameter.reason) == (
            ("held", fit.held[index]) if index in fit.held else ("estimated", None)
        )
    assert calibration.noise.position_mm == 1e3 * fit.sigma_position_m
    assert calibration.noise.orientation_mrad is None


def test_the_saved_file_predicts_exactly_what_the_fit_predicts(learnt, tmp_path, joints):
    calibration, fit = learnt
    calibration.save(tmp_path / "c.json")
    model = load_calibration(tmp_path / "c.json", fit.model.robot).model
    assert np.array_equal(model.predict(joints), fit.model.predict(joints))
    assert np.array_equal(model.predict_nominal(joints), fit.model.predict_nominal(joints))


def test_stated_frames_are_called_given_and_fitted_ones_registered(real, data, calibration):
    assert (calibration.base.nominal_source, calibration.tool.nominal_source) == ("given", "given")
    assert calibration.robot.source == "ur5_cell"
    unknown = learn(real.robot, replace(data, X_MB_nominal=None, X_FE_nominal=None))[0]
    assert (unknown.base.nominal_source, unknown.tool.nominal_source) == ("registered", "registered")


def test_it_says_what_it_is_doing(learnt, told):
    assert told
    assert any(str(POSES) in text for text in told)
    assert any("cross-validation" in text for text in told)


def test_where_no_pose_can_be_spared_the_accuracy_is_left_open(real, joints):
    calibration, *_ = learn(real.robot, measure(real, joints[:12], Campaign()))
    assert calibration.heldout is None


def test_measured_orientations_have_their_accuracy_and_noise_stated(real, joints):
    data = measure(real, joints[:100], Campaign(orientation_noise_mrad=0.05))
    calibration, *_ = learn(real.robot, data)
    assert calibration.data.has_orientation
    assert calibration.noise.orientation_mrad == pytest.approx(0.05, rel=0.1)
    # Mean length of a vector of three such noises: 1.596 times one of them.
    assert calibration.heldout.calibrated.orientation_mrad.mean == pytest.approx(0.05 * 1.596, rel=0.15)


def test_visits_of_one_pose_are_held_back_together(real, joints):
    """Else its error would be that of a pose which the fit had seen, and its barycentre would hide the noise."""
    data = measure(real, joints[:40], Campaign(repeats=5, noise_mm=0.1))
    calibration, *_ = learn(real.robot, data)
    model = calibration.model
    fresh = joints[POSES:]
    bias = 1e3 * np.linalg.norm(model.predict(fresh)[:, :3, 3] - real.reflector_poses(fresh)[:, :3, 3], axis=1)
    of_barycentre = 0.1 / np.sqrt(5)
    expected = np.sqrt(np.mean(bias**2) + 3 * of_barycentre**2)
    assert calibration.heldout.calibrated.position_mm.rms == pytest.approx(expected, rel=0.2)


def test_the_name_and_the_hash_of_the_data_file_are_kept(real, data, tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text(to_csv(data))
    calibration, *_ = learn(real.robot, read_measurements(path, real.robot))
    assert calibration.data.file == "poses.csv"
    assert calibration.data.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert {"truepath", "python", "numpy", "drake", "casadi"} <= set(calibration.software)


def test_two_runs_on_the_same_data_give_the_same_robot(real, data, calibration):
    again, *_ = learn(real.robot, data, source="ur5_cell")
    assert again.model_dump(exclude={"created_utc"}) == calibration.model_dump(exclude={"created_utc"})
