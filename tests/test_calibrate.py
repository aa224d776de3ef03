"""Calibration of virtual robots. The truth is Drake's; see truepath.virtual.truth and drake_arm."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drake_arm import DrakeArm, random_joints
from scipy.spatial.transform import Rotation
from truepath import plants
from truepath.calibrate import calibrate
from truepath.errors import CalibrationError
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure
from truepath.virtual.truth import true_deviations

ROOT = Path(__file__).parents[1]
POSES, NOISE_M, ORIENTATION_NOISE_RAD = 300, 2e-5, 5e-5
WITH_ORIENTATION = Campaign(orientation_noise_mrad=0.05)
REDUNDANT_BASE = {*(f"axis1.{field}" for field in ("pos_x", "pos_y", "rot_x", "rot_y")), "axis2.pos_y", "axis2.rot_y"}
PROBE_ORIENTATION = {"tool.rot_x", "tool.rot_y", "tool.rot_z"}

# Six joints, a spherical wrist, and two parallel axes only: not a UR.
ELBOW_ARM_JOINTS = (  # axis, origin on the link before
    ("0 0 1", "0 0 0.40"),
    ("0 1 0", "0.18 0 0.10"),
    ("0 1 0", "0 0 0.60"),
    ("1 0 0", "0.10 0 0.12"),
    ("0 1 0", "0.52 0 0"),
    ("1 0 0", "0.08 0 0"),
)


def load_study():
    """The workflow, which lies in no package."""
    spec = importlib.util.spec_from_file_location("coverage_study", ROOT / "workflows" / "coverage_study.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


study = load_study()


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


def test_a_perfect_robot_is_found_to_be_perfect(ur5):
    arm = DrakeArm("ur5")
    fit = calibrate(ur5, arm.measure(random_joints(ur5, POSES, 3), [-0.07, 0.0, 0.031], 0.02, seed=3))
    free = (fit.sigma > 0) & (np.arange(len(fit.sigma)) < 24)
    assert (np.abs(fit.model.p[free]) < 4 * fit.sigma[free]).all()


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


def test_a_reflector_on_the_axis_of_joint_6_leaves_its_tilt_barely_seen_and_predicts_as_well(ur5):
    arm, p_FE = DrakeArm("ur5", seed=5), [0.0, 0.0, 0.031]
    q = random_joints(ur5, POSES, 5)
    fit = calibrate(ur5, arm.measure(q, p_FE, 0.02, seed=5))
    assert {str(fit.names[i]) for i in fit.barely_seen} == {"axis6.rot_x", "axis6.rot_y"}
    assert fit.sigma_position_m == pytest.approx(NOISE_M, rel=0.1)
    fresh = arm.measure(random_joints(ur5, 100, 6), p_FE, 0.0, seed=0)
    assert np.linalg.norm(fit.model.predict(fresh.q_rad)[:, :3, 3] - fresh.p_ME, axis=1).max() < NOISE_M


def test_a_joint_that_never_moved_has_its_axis_held(ur5):
    arm, p_FE = DrakeArm("ur5", seed=6), [-0.07, 0.0, 0.031]
    q, fresh = random_joints(ur5, POSES, 6), random_joints(ur5, 100, 7)
    q[:, 5] = fresh[:, 5] = 0.4
    fit = calibrate(ur5, arm.measure(q, p_FE, 0.02, seed=6))
    held = held_names(fit)
    assert all(any(name == f"axis6.{field}" for name in held) for field in ("pos_x", "pos_y", "rot_x", "rot_y")), held
    truth = arm.measure(fresh, p_FE, 0.0, seed=0).p_ME
    assert np.linalg.norm(fit.model.predict(fresh)[:, :3, 3] - truth, axis=1).max() < 1.5 * NOISE_M


# Other arms


def fits_to_the_noise(spec, seed):
    """Calibrates a perturbed arm; asserts that fresh poses are met."""
    robot, arm, p_FE = plants.load_robot(spec), DrakeArm(spec, seed), [-0.07, 0.02, 0.05]
    fit = calibrate(robot, arm.measure(random_joints(robot, 400, seed), p_FE, 0.02, seed))
    fresh = arm.measure(random_joints(robot, 100, seed + 1), p_FE, 0.0, seed)
    nominal = np.linalg.norm(fit.model.predict_nominal(fresh.q_rad)[:, :3, 3] - fresh.p_ME, axis=1)
    error = np.linalg.norm(fit.model.predict(fresh.q_rad)[:, :3, 3] - fresh.p_ME, axis=1)
    assert nominal.mean() > 2e-4
    assert error.max() < 1.5 * NOISE_M
    assert fit.sigma_position_m == pytest.approx(NOISE_M, rel=0.08)
    return fit


@pytest.mark.parametrize("seed", [1, 3])
def test_an_arm_of_seven_joints_is_calibrated_to_the_noise_with_deviations_of_the_size_of_the_errors(
    seven_joint_arm, seed
):
    fit = fits_to_the_noise(seven_joint_arm, seed)
    assert len(fit.names) == 4 * 7 + 12
    assert len(held_names(fit)) == 6 + 3
    assert np.abs(fit.model.p).max() < 0.005


def test_an_arm_with_a_spherical_wrist_is_calibrated_to_the_noise(tmp_path):
    parts = []
    for number, (axis, xyz) in enumerate(ELBOW_ARM_JOINTS, start=1):
        carrier = f"link{number - 1}" if number > 1 else "base"
        parts.append(
            f'<link name="link{number}"/><joint name="j{number}" type="revolute"><parent link="{carrier}"/>'
            f'<child link="link{number}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>'
            '<limit lower="-2.8" upper="2.8" velocity="2" effort="100"/></joint>'
        )
    flange = (
        '<link name="flange"/><joint name="mount" type="fixed"><parent link="link6"/><child link="flange"/>'
        '<origin xyz="0.1 0 0" rpy="0 1.5707963 0"/></joint>'
    )
    urdf = tmp_path / "elbow.urdf"
    urdf.write_text(f'<robot name="elbow"><link name="base"/>{"".join(parts)}{flange}</robot>')
    fits_to_the_noise(urdf, 2)


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


# Refusals


def refusal(robot, data):
    with pytest.raises(CalibrationError) as caught:
        calibrate(robot, data)
    return str(caught.value)


def test_too_few_poses_are_refused_with_the_number_needed(real, data, joints):
    text = refusal(real.robot, data.subset(np.arange(9)))
    assert "too few poses for 27 parameters" in text
    assert "at least 12 different poses" in text
    assert "found:    9" in text
    calibrate(real.robot, data.subset(np.arange(12)))
    text = refusal(real.robot, measure(real, joints[:7], WITH_ORIENTATION))
    assert "at least 8 different poses with 6 readings each" in text


def test_repeated_visits_count_as_one_pose(real, joints):
    text = refusal(real.robot, measure(real, joints[:9], Campaign(repeats=10)))
    assert "too few poses" in text
    assert "found:    9" in text


def test_poses_that_are_all_alike_are_refused(real, joints):
    text = refusal(real.robot, measure(real, np.tile(joints[:1], (40, 1)), Campaign()))
    assert "all poses are alike" in text
    assert "joints that move" in text


def test_repeated_visits_count_as_one_pose_without_their_pose_id_too(real, joints):
    text = refusal(real.robot, measure(real, np.tile(joints[:3], (20, 1)), Campaign()))
    assert "too few poses" in text
    assert "found:    3" in text


@pytest.mark.parametrize("moving", [0, 5], ids=["joint 1", "joint 6"])
def test_poses_in_which_a_single_joint_moves_are_refused(real, joints, moving):
    q = np.tile(joints[:1], (40, 1))
    q[:, moving] = np.linspace(-3, 3, 40)
    refusal(real.robot, measure(real, q, Campaign()))


@pytest.mark.parametrize("campaign", [Campaign(), WITH_ORIENTATION], ids=["3d", "6d"])
@pytest.mark.parametrize(
    ("field", "factor"),
    [("q_rad", 180 / np.pi), ("q_rad", np.pi / 180), ("p_ME", 1e3), ("p_ME", 1e-3)],
    ids=["degrees as radians", "radians as degrees", "mm as m", "m as mm"],
)
def test_mixed_up_units_are_refused_and_suspected(real, joints, campaign, field, factor):
    data = measure(real, joints[:POSES], campaign)
    text = refusal(real.robot, replace(data, **{field: factor * getattr(data, field)}))
    assert "radians and degrees or mm and m mixed up" in text


def test_the_data_of_another_robot_are_refused(data, ur10):
    assert "another robot" in refusal(ur10, data)


def test_joints_in_another_order_are_refused(real, data):
    assert "joints in another order" in refusal(real.robot, replace(data, q_rad=data.q_rad[:, ::-1]))


# Statistics over many robots


def test_the_95_percent_intervals_hold_the_truth_of_a_few_robots():
    result = study.run_study(6)
    assert result.complaints() == []
    assert 0.90 <= result.coverage <= 0.99


@pytest.mark.slow
@pytest.mark.parametrize("orientation_noise_mrad", [None, 0.05])
def test_the_95_percent_intervals_hold_the_truth_of_fifty_robots(orientation_noise_mrad):
    result = study.run_study(50, orientation_noise_mrad=orientation_noise_mrad)
    assert result.complaints() == []
    assert 0.90 <= result.coverage <= 0.99


def test_the_study_prints_a_table_and_exits_with_its_verdict(capsys, monkeypatch):
    assert study.main(["--seeds", "2", "--poses", "60"]) in (0, 1)
    assert "coverage" in capsys.readouterr().out
    monkeypatch.setattr(study, "COVERAGE", (0.999, 1.0))
    assert study.main(["--seeds", "2", "--poses", "60"]) == 1
    assert "not as it should be: 95 % intervals hold the truth in" in capsys.readouterr().out


def test_quaternions_that_turn_the_other_way_are_refused(real, joints):
    data = measure(real, joints[:60], Campaign(orientation_noise_mrad=0.05))
    text = refusal(real.robot, replace(data, R_ME=np.swapaxes(data.R_ME, 1, 2)))
    assert "qw, qx, qy, qz" in text


def test_what_is_barely_seen_widens_the_uncertainty_of_all_that_hangs_on_it(ur5):
    """With the reflector on axis 6 its place and its tilt cannot be told apart: sigma must say so."""
    arm = DrakeArm("ur5", seed=8)
    on_axis, beside = (
        calibrate(ur5, arm.measure(random_joints(ur5, 200, 8), p_FE, 0.02, seed=8))
        for p_FE in ([0.0, 0.0, 0.031], [0.07, 0.0, 0.031])
    )
    position = [i for i, name in enumerate(on_axis.names) if str(name) in ("axis6.pos_x", "axis6.pos_y")]
    assert (on_axis.sigma[position] > 20 * beside.sigma[position]).all()
