"""Calibration of virtual robots finds the truth, which is Drake's: see ``truepath.virtual.truth``."""

from dataclasses import replace

import numpy as np
import pytest
from coverage_workflow import study
from scipy.spatial.transform import Rotation
from truepath.calibrate import calibrate
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure
from truepath.virtual.truth import true_deviations

POSES, NOISE_M, ORIENTATION_NOISE_RAD = 300, 2e-5, 5e-5
WITH_ORIENTATION = Campaign(orientation_noise_mrad=0.05)
REDUNDANT_BASE = {*(f"axis1.{field}" for field in ("pos_x", "pos_y", "rot_x", "rot_y")), "axis2.pos_y", "axis2.rot_y"}
PROBE_ORIENTATION = {"tool.rot_x", "tool.rot_y", "tool.rot_z"}


@pytest.fixture(scope="module")
def real():
    """A robot with hidden errors."""
    return RealRobot("ur5", 0)


@pytest.fixture(scope="module")
def joints(real):
    """Joints free of collision: 300 to fit and 100 to check."""
    return free_poses(real, POSES + 100, np.random.default_rng(0))


@pytest.fixture(scope="module")
def data(real, joints):
    return measure(real, joints[:POSES], Campaign())


@pytest.fixture(scope="module")
def fit(real, data):
    return calibrate(real.robot, data)


@pytest.fixture(scope="module")
def fit_6d(real, joints):
    return calibrate(real.robot, measure(real, joints[:POSES], WITH_ORIENTATION))


@pytest.fixture(scope="module")
def error_on_fresh_poses(real, joints):
    """Function: largest distance in m between prediction and Drake's truth on the 100 poses kept apart."""
    q = joints[POSES:]
    truth = real.reflector_poses(q)[:, :3, 3]
    return lambda fit: np.linalg.norm(fit.model.predict(q)[:, :3, 3] - truth, axis=1).max()


def held_names(fit):
    return {str(fit.names[index]) for index in fit.held}


def spoil(data, rows, size_m, seed=1):
    """The data with that many metres of error in some rows, in random directions."""
    direction = np.random.default_rng(seed).normal(size=(len(rows), 3))
    p_ME = data.p_ME.copy()
    p_ME[rows] += size_m * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return replace(data, p_ME=p_ME)


# The truth is found


@pytest.mark.parametrize("seed", range(6))
def test_every_identifiable_parameter_lies_within_four_sigma_of_the_truth(seed):
    real = RealRobot("ur5", seed)
    q = free_poses(real, POSES, np.random.default_rng(seed))
    fit = calibrate(real.robot, measure(real, q, Campaign(seed=seed)))
    sigmas = study.deviations_in_sigmas(real, fit)
    assert len(sigmas) == 27
    assert max(map(abs, sigmas.values())) < 4, sigmas


@pytest.mark.parametrize("robot", ["ur5", "ur10"])
def test_the_same_holds_for_measured_orientations(robot):
    real = RealRobot(robot, 7)
    q = free_poses(real, POSES, np.random.default_rng(7))
    sigmas = study.deviations_in_sigmas(real, calibrate(real.robot, measure(real, q, WITH_ORIENTATION)))
    assert len(sigmas) == 30
    assert max(map(abs, sigmas.values())) < 4, sigmas


def test_deviations_are_found_to_a_fraction_of_their_size(real, fit):
    truth = true_deviations(real)[0]
    found = fit.model.p[: truth.size].reshape(truth.shape)
    assert np.abs(truth).max() > 5e-4
    assert np.abs(found - truth).max() < 1e-4


def test_what_the_calibrated_robot_predicts_is_far_below_the_noise(fit, fit_6d, error_on_fresh_poses):
    assert error_on_fresh_poses(fit) < NOISE_M
    assert error_on_fresh_poses(fit_6d) < NOISE_M


def test_orientations_are_predicted_below_their_noise(real, joints, fit_6d):
    q = joints[POSES:]
    error = fit_6d.model.predict(q)[:, :3, :3] @ np.swapaxes(real.reflector_poses(q)[:, :3, :3], 1, 2)
    assert Rotation.from_matrix(error).magnitude().max() < ORIENTATION_NOISE_RAD


def test_the_noise_is_estimated_within_a_few_percent(fit, fit_6d):
    assert fit.sigma_position_m == pytest.approx(NOISE_M, rel=0.06)
    assert fit.sigma_orientation_rad is None
    assert fit_6d.sigma_position_m == pytest.approx(NOISE_M, rel=0.06)
    assert fit_6d.sigma_orientation_rad == pytest.approx(ORIENTATION_NOISE_RAD, rel=0.06)


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_both_noises_are_found_whatever_their_ratio(real, joints, factor):
    campaign = Campaign(noise_mm=0.02, orientation_noise_mrad=0.05 * factor)
    fit = calibrate(real.robot, measure(real, joints[:POSES], campaign))
    assert fit.sigma_position_m == pytest.approx(NOISE_M, rel=0.08)
    assert fit.sigma_orientation_rad == pytest.approx(factor * ORIENTATION_NOISE_RAD, rel=0.08)
    assert max(map(abs, study.deviations_in_sigmas(real, fit).values())) < 4


@pytest.mark.parametrize("orientation_noise_mrad", [None, 0.0])
def test_data_without_noise_are_met_to_a_tenth_of_a_micrometre(real, joints, orientation_noise_mrad):
    campaign = Campaign(noise_mm=0.0, orientation_noise_mrad=orientation_noise_mrad)
    fit = calibrate(real.robot, measure(real, joints[:POSES], campaign))
    assert np.abs(fit.residual).max() < 1e-7
    assert not fit.outlier.any()


def test_the_tracker_may_stand_anywhere(real, joints, fit):
    seen = measure(real, joints, Campaign(tracker=True, seed=4))
    elsewhere = calibrate(real.robot, seen.subset(np.arange(POSES)))
    assert np.linalg.norm(elsewhere.model.X_MB[:3, 3] - fit.model.X_MB[:3, 3]) > 1.0
    error = elsewhere.model.predict(joints[POSES:])[:, :3, 3] - seen.p_ME[POSES:]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(NOISE_M, rel=0.2)
    truth = true_deviations(real)[0].ravel()
    free = np.array([i for i in range(truth.size) if i not in elsewhere.held])
    assert (np.abs(elsewhere.model.p[free] - truth[free]) < 4 * elsewhere.sigma[free]).all()


def test_turning_the_measurement_frame_upside_down_changes_no_deviation(real, data, fit):
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.from_rotvec([2.9, 0.8, -0.4]).as_matrix(), [30.0, -20.0, 5.0]
    moved = calibrate(real.robot, replace(data, p_ME=data.p_ME @ X[:3, :3].T + X[:3, 3]))
    assert np.abs(moved.model.p - fit.model.p).max() < 1e-8
    assert np.abs(moved.model.X_MB - X @ fit.model.X_MB).max() < 1e-8


def test_the_order_of_the_poses_does_not_matter(real, data, fit):
    order = np.random.default_rng(0).permutation(len(data))
    shuffled = calibrate(real.robot, data.subset(order))
    assert np.abs(shuffled.model.p - fit.model.p).max() < 1e-9
    assert np.allclose(shuffled.residual, fit.residual[order], atol=1e-9)


def test_repeated_visits_make_the_result_surer(real, joints, fit):
    repeated = calibrate(real.robot, measure(real, joints[:POSES], Campaign(repeats=4, seed=2)))
    free = fit.sigma > 0
    assert repeated.sigma[free] / fit.sigma[free] == pytest.approx(0.5, abs=0.05)
    assert max(map(abs, study.deviations_in_sigmas(real, repeated).values())) < 4


def test_the_residual_is_predicted_minus_measured(data, fit):
    assert np.allclose(fit.residual, fit.model.predict(data.q_rad)[:, :3, 3] - data.p_ME, atol=1e-9)


def test_stated_frames_are_kept_for_the_nominal_robot_and_do_not_change_the_fit(real, data, fit):
    stated = replace(data, X_MB_nominal=real.robot.X_WB, X_FE_nominal=real.robot.X_FR)
    other = calibrate(real.robot, stated)
    assert np.array_equal(other.model.X_MB_nominal, real.robot.X_WB)
    assert np.allclose(other.model.X_FE_nominal[:3, 3], real.robot.X_FR[:3, 3])
    assert (other.model.base_is_given, other.model.tool_is_given) == (True, True)
    assert (fit.model.base_is_given, fit.model.tool_is_given) == (False, False)
    assert np.allclose(other.model.p, fit.model.p, atol=1e-10)


# What the data cannot see


def test_what_base_and_axes_share_is_held_at_the_base_and_named(fit, fit_6d):
    assert held_names(fit) == REDUNDANT_BASE | PROBE_ORIENTATION
    assert held_names(fit_6d) == REDUNDANT_BASE
    assert all("redundant" in reason for reason in fit.held.values())


def test_held_parameters_stay_at_nominal_without_a_standard_deviation(fit):
    held = sorted(fit.held)
    assert not fit.model.p[held].any()
    assert not fit.covariance[held].any()
    assert not fit.covariance[:, held].any()
    assert (np.delete(fit.sigma, held) > 0).all()


# Gross errors


@pytest.mark.parametrize("size_m", [0.5, 0.002])
@pytest.mark.parametrize("campaign", [Campaign(), WITH_ORIENTATION], ids=["3d", "6d"])
def test_one_gross_error_in_ten_is_found_reported_and_harmless(real, joints, error_on_fresh_poses, size_m, campaign):
    rows = np.random.default_rng(0).permutation(POSES)[: POSES // 10]
    fit = calibrate(real.robot, spoil(measure(real, joints[:POSES], campaign), rows, size_m))
    assert np.array_equal(np.flatnonzero(fit.outlier), np.sort(rows))
    assert fit.sigma_position_m == pytest.approx(NOISE_M, rel=0.06)
    assert error_on_fresh_poses(fit) < NOISE_M
    assert max(map(abs, study.deviations_in_sigmas(real, fit).values())) < 4


def test_gross_errors_of_orientation_alone_are_found_too(real, joints, error_on_fresh_poses):
    data = measure(real, joints[:POSES], WITH_ORIENTATION)
    R_ME = data.R_ME.copy()
    R_ME[:30] = Rotation.from_rotvec([0.0, 0.02, 0.0]).as_matrix() @ R_ME[:30]
    fit = calibrate(real.robot, replace(data, R_ME=R_ME))
    assert np.array_equal(np.flatnonzero(fit.outlier), np.arange(30))
    assert error_on_fresh_poses(fit) < NOISE_M


def test_errors_that_all_point_the_same_way_do_not_draw_the_fit_along(real, data, error_on_fresh_poses):
    p_ME = data.p_ME.copy()
    p_ME[:30] += [0.1, 0.0, 0.0]
    fit = calibrate(real.robot, replace(data, p_ME=p_ME))
    assert np.array_equal(np.flatnonzero(fit.outlier), np.arange(30))
    assert error_on_fresh_poses(fit) < NOISE_M


def test_clean_data_lose_no_pose(fit, fit_6d):
    assert not fit.outlier.any()
    assert not fit_6d.outlier.any()
