"""The virtual cell: what it hides, what it measures, and that its truth is the truth."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truepath import plants
from truepath.errors import InputError
from truepath.readers import read_measurements
from truepath.virtual.real_robot import Imperfection, RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure, to_csv, truth_json
from truepath.virtual.truth import HELD, true_deviations
from truth_by_drake import reflector_poses

PERFECT = Imperfection(0.0, 0.0, 0.0, 0.0, 0.0)
HOME = np.array([[0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0]])


@pytest.fixture(scope="module")
def real():
    return RealRobot("ur5", 0)


@pytest.fixture(scope="module")
def joints(real):
    return free_poses(real, 60, np.random.default_rng(0))


# The robot


def test_without_imperfection_the_real_robot_is_the_nominal_one(joints):
    perfect = RealRobot("ur5", 0, PERFECT)
    assert np.abs(perfect.reflector_poses(joints) - reflector_poses({}, joints)).max() < 1e-12


def test_hidden_errors_move_the_tool_by_millimetres(real, joints):
    moved = real.reflector_poses(joints)[:, :3, 3] - reflector_poses({}, joints)[:, :3, 3]
    assert 5e-4 < np.linalg.norm(moved, axis=1).mean() < 1e-2


def test_the_truth_file_is_all_it_takes_to_build_the_same_robot(real, joints):
    told = json.loads(truth_json(real, Campaign()))
    assert len(told["hidden_frame_errors"]) == 6 + 1 + 1  # joints, mount of the base, holder of the reflector
    assert np.abs(real.reflector_poses(joints) - reflector_poses(told, joints)).max() < 1e-12


def test_the_truth_file_tells_the_robot_s_seed_from_that_of_the_poses():
    told = json.loads(truth_json(RealRobot("ur5", 7), Campaign(seed=3)))
    assert (told["robot_seed"], told["campaign"]["poses_seed"]) == (7, 3)
    assert "seed" not in told["campaign"]


def test_the_same_seed_hides_the_same_errors_and_another_seed_others(real, joints):
    again, other = RealRobot("ur5", 0), RealRobot("ur5", 1)
    assert np.array_equal(again.reflector_poses(joints), real.reflector_poses(joints))
    assert np.abs(other.reflector_poses(joints) - real.reflector_poses(joints)).max() > 1e-4


def test_the_nominal_robot_it_tells_of_has_none_of_the_hidden_errors(real):
    assert real.robot.model_sha256 == plants.load_robot("ur5_cell").model_sha256


@pytest.mark.parametrize("spec", ["ur5", "ur5_cell"])
def test_a_built_in_robot_stands_for_its_cell(spec):
    assert RealRobot(spec, 0).spec == "ur5_cell"


def test_a_robot_without_a_reflector_is_refused(seven_joint_arm):
    with pytest.raises(InputError, match="reflector"):
        RealRobot(seven_joint_arm, 0)


def test_a_negative_seed_is_refused():
    with pytest.raises(InputError, match="seed"):
        RealRobot("ur5", -1)


# Its truth in the terms of a calibration


@pytest.mark.parametrize("spec", ["ur5", "ur10"])
@pytest.mark.parametrize("seed", range(3))
def test_the_true_deviations_lead_to_the_true_poses(spec, seed):
    """Exponentials of the true axis lines, one after the other, end where Drake says the reflector is."""
    real = RealRobot(spec, seed)
    deviations, X_WB, X_FE = true_deviations(real)
    for q in np.random.default_rng(seed).uniform(-3, 3, (5, 6)):
        X = X_WB.copy()
        for i, (x, y, rx, ry) in enumerate(deviations):
            R = real.robot.X_BA[i][:3, :3]
            point = real.robot.X_BA[i][:3, 3] + R @ [x, y, 0.0]
            direction = R @ Rotation.from_euler("XYZ", [rx, ry, 0.0]).as_matrix()[:, 2]
            step = np.eye(4)
            step[:3, :3] = Rotation.from_rotvec(q[i] * direction).as_matrix()
            step[:3, 3] = point - step[:3, :3] @ point
            X = X @ step
        X = X @ real.robot.X_BF @ X_FE
        assert np.abs(X - real.reflector_poses(q[None])[0]).max() < 1e-9


def test_what_a_calibration_holds_is_zero_in_the_truth_too(real):
    deviations = true_deviations(real)[0].ravel()
    assert np.abs(deviations[list(HELD)]).max() < 1e-12
    assert np.abs(np.delete(deviations, HELD)).min() > 0


def test_a_perfect_robot_has_no_deviations_and_nominal_frames():
    perfect = RealRobot("ur5", 3, PERFECT)
    deviations, X_WB, X_FE = true_deviations(perfect)
    assert np.abs(deviations).max() < 1e-12
    assert np.abs(X_WB - perfect.robot.X_WB).max() < 1e-12
    assert np.abs(X_FE - perfect.robot.X_FR).max() < 1e-12


# Poses


def test_poses_are_within_limits_free_of_collision_and_in_sight(real, joints):
    assert joints.shape == (60, 6)
    assert ((joints >= real.robot.lower_rad) & (joints <= real.robot.upper_rad)).all()
    assert all(real.is_free(q) for q in joints)
    assert (real.reflector_poses(joints)[:, 2, 3] > 0.05).all()
    assert (np.ptp(joints, axis=0) > np.pi).all()


def test_a_pose_with_the_arm_in_the_table_is_not_free(real):
    assert real.is_free(HOME[0])
    assert not real.is_free(np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0]))


# Measurements


def test_noise_has_the_size_that_was_asked_for(real):
    q = np.tile(HOME, (3000, 1))
    data = measure(real, q, Campaign(noise_mm=0.5, orientation_noise_mrad=0.2))
    truth = real.reflector_poses(HOME)[0]
    assert np.std(data.p_ME - truth[:3, 3], axis=0) == pytest.approx([5e-4] * 3, rel=0.05)
    turn = Rotation.from_matrix(data.R_ME @ truth[:3, :3].T).as_rotvec()
    assert np.std(turn, axis=0) == pytest.approx([2e-4] * 3, rel=0.05)
    assert np.abs(np.corrcoef(np.hstack([data.p_ME, turn]), rowvar=False) - np.eye(6)).max() < 0.08


def test_without_noise_the_truth_is_measured(real, joints):
    data = measure(real, joints, Campaign(noise_mm=0.0, orientation_noise_mrad=0.0))
    truth = real.reflector_poses(joints)
    assert np.array_equal(data.p_ME, truth[:, :3, 3])
    assert np.allclose(data.R_ME, truth[:, :3, :3], atol=1e-12)


def test_a_tracker_sees_the_same_points_from_metres_away(real, joints):
    """One rigid motion, nearly level, takes what is seen in the world to what the tracker sees."""
    world = measure(real, joints, Campaign(noise_mm=0.0)).p_ME
    seen = measure(real, joints, Campaign(noise_mm=0.0, tracker=True)).p_ME
    a, b = world - world.mean(axis=0), seen - seen.mean(axis=0)
    rotation, rssd = Rotation.align_vectors(b, a)
    assert rssd < 1e-9
    assert np.linalg.norm(seen.mean(axis=0) - world.mean(axis=0)) > 1.0
    assert rotation.as_matrix()[2, 2] > 0.99


def test_repeats_come_round_after_round_with_fresh_noise(real, joints):
    data = measure(real, joints[:5], Campaign(repeats=3))
    assert data.pose_id.tolist() == [0, 1, 2, 3, 4] * 3
    assert np.array_equal(data.q_rad, np.tile(joints[:5], (3, 1)))
    assert 0 < np.abs(data.p_ME[:5] - data.p_ME[5:10]).max() < 2e-4


def test_the_same_seed_measures_the_same(real, joints):
    first, again, other = (measure(real, joints, Campaign(seed=seed)) for seed in (1, 1, 2))
    assert np.array_equal(first.p_ME, again.p_ME)
    assert not np.array_equal(first.p_ME, other.p_ME)


@pytest.mark.parametrize("campaign", [Campaign(), Campaign(orientation_noise_mrad=0.05, repeats=2, tracker=True)])
def test_the_csv_reads_back_what_was_measured(real, joints, campaign, tmp_path):
    data = measure(real, joints, campaign)
    (tmp_path / "poses.csv").write_text(to_csv(data))
    read = read_measurements(tmp_path / "poses.csv", real.robot)
    assert np.abs(read.q_rad - data.q_rad).max() < 1e-12
    assert np.abs(read.p_ME - data.p_ME).max() < 1e-9
    assert (read.R_ME is None) == (data.R_ME is None)
    if data.R_ME is not None:
        assert np.abs(read.R_ME - data.R_ME).max() < 1e-11
    visits = [groups[:, None] == groups for groups in (read.groups(), data.groups())]
    assert np.array_equal(*visits)


@pytest.mark.parametrize(
    "nonsense", [{"poses": 0}, {"repeats": 0}, {"noise_mm": -1.0}, {"noise_mm": float("nan")}, {"seed": -1}]
)
def test_campaigns_that_make_no_sense_are_refused(nonsense):
    with pytest.raises(InputError):
        replace(Campaign(), **nonsense)
