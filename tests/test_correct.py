"""Correction. What it is worth is measured by Drake: on a robot with hidden errors, and on a plant that carries
the calibrated frames; neither uses the kinematics under test."""

from dataclasses import replace

import numpy as np
import pytest
from drake_arm import DrakeArm, random_joints
from scipy.spatial.transform import Rotation
from smooth_path import HOME, measured, smooth_path
from truepath import plants
from truepath.calibrate import calibrate
from truepath.correct import correct
from truepath.export import set_calibrated_frames
from truepath.inverse import solve
from truepath.learn import learn
from truepath.model import nominal_flange_poses, nominal_model
from truepath.programs.toolpath_csv import read_toolpath
from truepath.rewriting.rewrite import rewrite_program
from truepath.virtual.real_robot import RealRobot

WELD_PATH = plants.models_dir() / "ur5" / "weld_path.csv"
POSE_PATH = plants.models_dir() / "ur5" / "pose_path.csv"
MICROMETRE, MICRORADIAN = 1e-6, 1e-6


@pytest.fixture(scope="module")
def real():
    return RealRobot("ur5", 0)


@pytest.fixture(scope="module")
def data(real):
    return measured(real)


@pytest.fixture(scope="module")
def registered(real, data):
    """A calibration for which nobody stated where robot and reflector are meant to be."""
    return calibrate(real.robot, data).model


@pytest.fixture(scope="module")
def calibration(real, data):
    """A calibration with stated frames."""
    stated = replace(data, X_MB_nominal=real.robot.X_WB, X_FE_nominal=real.robot.X_FR)
    return learn(real.robot, stated, source="ur5_cell")[0]


@pytest.fixture(scope="module")
def path():
    return smooth_path()


@pytest.fixture(scope="module")
def drake():
    """The nominal arm."""
    return DrakeArm("ur5")


def calibrated_drake(model, spec="ur5"):
    """An arm in Drake that moves as the calibration says."""
    arm = DrakeArm(spec)
    set_calibrated_frames(model, arm.plant, arm.context)
    return arm


def angles(X, X_wanted):
    return Rotation.from_matrix(X[:, :3, :3] @ np.swapaxes(X_wanted[:, :3, :3], 1, 2)).magnitude()


def distances(X, X_wanted):
    return np.linalg.norm(X[:, :3, 3] - X_wanted[:, :3, 3], axis=1)


# The calibrated robot reaches what was programmed


def test_the_flange_is_within_a_micrometre_of_its_programmed_place_by_drake(registered, drake, path):
    wanted = drake.flange_poses(path)
    reached = calibrated_drake(registered).flange_poses(correct(registered, path).q_rad)
    assert distances(reached, wanted).max() < MICROMETRE
    assert angles(reached, wanted).max() < MICRORADIAN


def test_with_stated_frames_the_tool_is_within_a_micrometre_of_its_programmed_place_in_the_world(calibration, drake):
    model, q = calibration.model, read_toolpath(WELD_PATH, 6).q_rad
    wanted = model.X_MB_nominal @ drake.flange_poses(q) @ model.X_FE_nominal
    reached = model.X_MB @ calibrated_drake(model).flange_poses(correct(model, q).q_rad) @ model.X_FE
    assert distances(reached, wanted).max() < MICROMETRE
    assert angles(reached, wanted).max() < MICRORADIAN


def test_the_joints_in_the_file_still_reach_it_after_rounding(calibration, drake, tmp_path):
    corrected = rewrite_program(WELD_PATH, calibration)
    (tmp_path / "corrected.csv").write_bytes(corrected.content)
    q = read_toolpath(tmp_path / "corrected.csv", 6).q_rad
    model = calibration.model
    wanted = model.X_MB_nominal @ drake.flange_poses(corrected.plan.q_rad) @ model.X_FE_nominal
    reached = model.X_MB @ calibrated_drake(model).flange_poses(q) @ model.X_FE
    assert distances(reached, wanted).max() < MICROMETRE
    assert angles(reached, wanted).max() < MICRORADIAN


def test_a_path_of_poses_is_reached_within_a_micrometre_too(calibration, tmp_path):
    corrected = rewrite_program(POSE_PATH, calibration)
    model, programmed = calibration.model, read_toolpath(POSE_PATH, 6).X_BF
    reached = calibrated_drake(model).flange_poses(corrected.correction.q_rad)
    wanted = np.linalg.inv(model.X_MB) @ model.X_MB_nominal @ programmed @ model.X_FE_nominal
    assert distances(reached @ model.X_FE, wanted).max() < MICROMETRE
    assert angles(reached @ model.X_FE, wanted).max() < MICRORADIAN


def test_an_arm_of_seven_joints_is_corrected_within_a_micrometre(seven, seven_joint_arm):
    real, p_FE = DrakeArm(seven_joint_arm, seed=3), [0.05, -0.02, 0.1]
    fit = calibrate(seven, real.measure(random_joints(seven, 300, 3), p_FE, 0.02, seed=3))
    q = 0.3 + np.linspace(0, 1, 100)[:, None] * [0.5, 0.3, -0.4, 0.2, 0.1, 0.6, 0.4]
    wanted = DrakeArm(seven_joint_arm).flange_poses(q)
    corrected = correct(fit.model, q)
    reached = calibrated_drake(fit.model, seven_joint_arm).flange_poses(corrected.q_rad)
    assert distances(reached, wanted).max() < MICROMETRE
    assert angles(reached, wanted).max() < MICRORADIAN
    assert np.abs(corrected.q_rad - q).max() < 0.05


# The real robot gets there


def test_on_the_real_robot_the_tool_error_falls_from_millimetres_to_the_noise(real, calibration):
    corrected = rewrite_program(WELD_PATH, calibration)
    nominal = real.robot
    programmed = nominal.X_WB @ DrakeArm("ur5").flange_poses(corrected.plan.q_rad) @ nominal.X_FR
    before = distances(real.reflector_poses(corrected.plan.q_rad), programmed)
    after = distances(real.reflector_poses(corrected.correction.q_rad), programmed)
    assert before.mean() > 1e-3
    assert after.mean() < 2e-5
    assert after.max() < 4e-5


def test_the_error_that_was_predicted_is_the_error_that_drake_finds(real, calibration):
    corrected = rewrite_program(WELD_PATH, calibration)
    programmed = real.robot.X_WB @ DrakeArm("ur5").flange_poses(corrected.plan.q_rad) @ real.robot.X_FR
    before_mm = 1e3 * distances(real.reflector_poses(corrected.plan.q_rad), programmed)
    assert corrected.correction.error_before_mm == pytest.approx(before_mm, abs=0.04)
    assert corrected.correction.error_after_mm.max() < 1e-3


def test_without_stated_frames_the_path_is_right_relative_to_the_base_that_was_found(real, registered):
    """Nobody knows where the base is meant to be, so the whole path may be shifted; its shape is right."""
    q = read_toolpath(WELD_PATH, 6).q_rad
    wanted = registered.X_MB @ DrakeArm("ur5").flange_poses(q) @ registered.X_FE
    before = distances(real.reflector_poses(q), wanted)
    after = distances(real.reflector_poses(correct(registered, q).q_rad), wanted)
    assert before.mean() > 3e-4
    assert after.max() < 4e-5


def test_a_stated_probe_that_was_mounted_askew_moves_the_flange_back(real, data, registered):
    """The same calibration, but the reflector is said to belong 1 mm higher: then the flange is 1 mm too low."""
    higher = registered.X_FE.copy()
    higher[2, 3] += 1e-3
    stated = replace(registered, X_FE_nominal=higher, tool_is_given=True)
    q = HOME[None]
    difference = calibrated_drake(registered).flange_poses(
        np.concatenate([correct(stated, q).q_rad, correct(registered, q).q_rad])
    )
    moved = difference[1, :3, :3].T @ (difference[0, :3, 3] - difference[1, :3, 3])
    assert moved == pytest.approx([0.0, 0.0, 1e-3], abs=1e-6)


def test_the_errors_stated_before_and_after_are_those_of_the_tool(calibration):
    model, q = calibration.model, read_toolpath(WELD_PATH, 6).q_rad
    corrected = correct(model, q)
    wanted = (model.goal_flange_poses(nominal_flange_poses(model.robot, q)) @ model.X_FE)[:, :3, 3]
    for joints, stated in ((q, corrected.error_before_mm), (corrected.q_rad, corrected.error_after_mm)):
        tool = (model.flange_poses(joints) @ model.X_FE)[:, :3, 3]
        assert 1e3 * np.linalg.norm(tool - wanted, axis=1) == pytest.approx(stated, abs=1e-9)
    assert corrected.error_after_mm.max() < 1e-3


# What does not change


def test_a_robot_without_deviations_is_sent_where_the_program_says(ur5, path):
    corrected = correct(nominal_model(ur5), path)
    assert np.abs(corrected.q_rad - path).max() < 1e-9
    assert corrected.displacement_mm.max() < 1e-6
    assert corrected.warnings == []


def test_even_at_a_singularity_nothing_to_correct_changes_nothing(ur5, path):
    q = path.copy()
    q[:, 4] = 0.0
    assert np.abs(correct(nominal_model(ur5), q).q_rad - q).max() < 1e-9


def test_a_program_at_its_joint_limit_stays_there_if_nothing_is_wrong(ur5):
    q = HOME[None].copy()
    q[0, 0] = 6.283185307180  # 2 pi as twelve decimals write it, which is a little more
    assert np.abs(correct(nominal_model(ur5), q).q_rad - q).max() < 1e-9


def test_twenty_thousand_waypoints_are_corrected_as_a_hundred_are(registered):
    swing = np.sin(np.linspace(0, 40, 20_001))[:, None]
    q = HOME + swing * [0.5, 0.3, -0.4, 0.2, 0.4, 0.6]
    whole = correct(registered, q)
    assert len(whole.q_rad) == len(whole.error_before_mm) == len(whole.outside) == 20_001
    for first in (0, 10_000, 19_901):
        part = correct(registered, q[first : first + 100])
        assert np.array_equal(part.q_rad, whole.q_rad[first : first + 100])
        assert np.array_equal(part.displacement_mm, whole.displacement_mm[first : first + 100])


def test_every_posture_of_the_arm_keeps_its_branch(ur5, drake, registered):
    """The eight ways of a UR to reach one pose: each is corrected near itself, and all lead to the same place."""
    X = drake.flange_poses(HOME + np.array([0.3, 0.2, -0.3, 0.1, 0.4, 0.2]))
    starts = random_joints(ur5, 400, 0)
    found = solve(nominal_model(ur5).flange_poses_and_jacobian, np.tile(X, (400, 1, 1)), starts, max_iterations=60)
    q = (found.q_rad[found.converged] + np.pi) % (2 * np.pi) - np.pi
    q = q[np.unique(np.round(q, 4), axis=0, return_index=True)[1]]
    assert len(q) == 8
    corrected = np.array([correct(registered, posture[None]).q_rad[0] for posture in q])
    assert np.abs(corrected - q).max() < np.radians(2.0)
    reached = calibrated_drake(registered).flange_poses(corrected)
    assert distances(reached, X).max() < MICROMETRE
    assert angles(reached, X).max() < MICRORADIAN
