"""Which joints a controller takes for the poses of a program; whether they reach is Drake's word."""

import time
from dataclasses import replace

import numpy as np
import pytest
from denavit_hartenberg import askew, calibration_conf
from drake_arm import DrakeArm
from posture_truth import TURN, all_solutions, follow, misses, smooth, with_turns
from scipy.spatial.transform import Rotation
from truepath.controller import controller_of
from truepath.errors import InputError
from truepath.model import nominal_flange_poses
from truepath.plants import load_robot
from truepath.ur_postures import ThreeParallelAxes

# Along a program


@pytest.mark.parametrize("name", ["ur5", "ur10"])
@pytest.mark.parametrize("straight", [False, True])
def test_a_path_of_poses_is_followed_from_joints_that_are_given(name, straight):
    q, drake = smooth(300), DrakeArm(name)
    found = follow(load_robot(name), q, given=[0], straight=straight, X=drake.flange_poses(q))
    assert np.abs(found.q_rad - q).max() < 1e-7
    assert found.reached.all()
    assert found.certain.all()
    assert not (found.ambiguous | found.start_unknown).any()


def test_joints_that_are_given_stay_and_what_follows_starts_from_them(ur5):
    q = np.concatenate([smooth(20), smooth(20)])
    q[:, 5] -= 1.5
    q[20:, 5] += TURN
    found = follow(ur5, q, given=[0, 20])
    assert np.array_equal(found.q_rad[[0, 20]], q[[0, 20]])
    assert np.abs(found.q_rad - q).max() < 1e-7


def test_the_start_may_be_stated_apart(ur5):
    q = smooth(20)
    assert np.abs(follow(ur5, q, start=q[0] + 0.05).q_rad - q).max() < 1e-7
    other = follow(ur5, q, start=q[0] + [0, 0, 0, 0, 0, -TURN]).q_rad
    assert np.abs(other - q - [0, 0, 0, 0, 0, -TURN]).max() < 1e-7


def test_joints_near_a_pose_count_for_more_than_what_is_before_it(ur5):
    q = smooth(10)
    others = all_solutions(ur5, nominal_flange_poses(ur5, q[5:6])[0])
    near = np.full((10, 6), np.nan)
    for other in others:
        near[5] = other + np.random.default_rng(0).normal(scale=0.02, size=6)
        found = follow(ur5, q, given=[0], near=near)
        assert np.abs(found.q_rad[5] - other).max() < 1e-5
        assert found.certain[5]
        assert np.abs(found.q_rad[:5] - q[:5]).max() < 1e-7


def test_far_targets_are_reached_in_the_posture_nearest_of_all_that_there_are(ur5):
    rng = np.random.default_rng(7)
    q = rng.uniform(-np.pi, np.pi, (60, 6))
    found = follow(ur5, q, given=[0])
    assert found.reached.all()
    told = 0
    for k in range(1, 60):
        all_there_are = with_turns(
            all_solutions(ur5, nominal_flange_poses(ur5, q[k : k + 1])[0]), ur5.lower_rad, ur5.upper_rad
        )
        away = np.linalg.norm(all_there_are - found.q_rad[k - 1], axis=1)
        nearest = np.sort(away)
        assert np.linalg.norm(found.q_rad[k] - found.q_rad[k - 1]) == pytest.approx(nearest[0], abs=1e-6)
        if not found.ambiguous[k]:
            assert np.abs(found.q_rad[k] - all_there_are[np.argmin(away)]).max() < 1e-5
            assert nearest[1] > 1.09 * nearest[0]
            told += 1
    assert 15 < told < 59  # by chance some are nearly as near as others


def test_targets_may_be_written_in_any_order_and_several_may_follow_one(ur5):
    q = smooth(30)
    order = np.random.default_rng(0).permutation(30)
    place = np.argsort(order)  # target k of the path is written at place[k]
    previous = np.array([place[order[i] - 1] if order[i] > 0 else -1 for i in range(30)])
    found = follow(ur5, q[order], given=[place[0]], previous=previous)
    assert np.abs(found.q_rad - q[order]).max() < 1e-7
    fan = follow(ur5, q, given=[0], previous=[-1] + [0] * 29)
    assert np.abs(fan.q_rad - q).max() < 1e-7


def test_a_controllers_own_frames_and_kinematics_are_taken(ur10, tmp_path):
    arm, rows = askew("UR10", 1)
    path = tmp_path / "calibration.conf"
    path.write_text(calibration_conf("UR10", rows))
    controller = controller_of(ur10, path)
    q = smooth(200)
    for straight in (False, True):
        found = follow(controller, q, given=[0], straight=straight, X=arm(q))
        assert np.abs(found.q_rad - q).max() < 1e-7
        assert found.certain.all()


def test_an_arm_that_is_askew_reaches_all_that_it_says(ur10):
    """Poses all over the place, the start of each known: what is not told as ambiguous is the nearest."""
    rng = np.random.default_rng(3)
    error = np.tile(np.eye(4), (6, 1, 1))
    error[:, :3, :3] = Rotation.from_rotvec(rng.normal(scale=1e-3, size=(6, 3))).as_matrix()
    error[:, :3, 3] = rng.normal(scale=3e-4, size=(6, 3))
    arm = replace(ur10, X_BA=ur10.X_BA @ error)
    q = rng.uniform(-3, 3, (4000, 6))
    near = q + rng.normal(scale=0.003, size=q.shape)
    found = follow(arm, q, near=near)
    X = nominal_flange_poses(arm, q)
    assert misses(nominal_flange_poses(arm, found.q_rad[found.reached]), X[found.reached]) < 1e-6
    assert found.reached.mean() > 0.999
    farther = np.linalg.norm(found.q_rad - near, axis=1) > 1.05 * np.linalg.norm(q - near, axis=1) + 1e-3
    assert farther.sum() < 0.01 * len(q)
    assert (farther & ~found.ambiguous).sum() < 0.001 * len(q)
    assert found.ambiguous.mean() < 0.05


# Other arms


@pytest.fixture
def bent(ur5):
    """Six joints of which only 2 and 3 are parallel."""
    X_BA = ur5.X_BA.copy()
    X_BA[3, :3, :3] = Rotation.from_rotvec([0, 0, 0.7]).as_matrix() @ X_BA[3, :3, :3]
    return replace(ur5, name="bent", X_BA=X_BA)


@pytest.mark.parametrize("straight", [False, True])
def test_an_arm_without_a_closed_form_is_followed_in_small_steps(bent, straight):
    assert ThreeParallelAxes.of(bent) is None
    q = smooth(12)
    found = follow(bent, q, given=[0, 7], previous=[-1, 0, 1, 2, 2, -1, 5, -1, 7, 8, 9, 10], straight=straight)
    known = np.ones(12, bool)
    known[5:7] = False
    assert np.abs(found.q_rad - q)[known].max() < 1e-6
    assert np.array_equal(found.start_unknown, ~known)
    assert np.array_equal(found.certain, known)


def test_such_an_arm_says_what_it_cannot_reach(bent):
    q = smooth(4)
    X = nominal_flange_poses(bent, q)
    X[1, :3, 3] *= 3
    near = np.full((4, 6), np.nan)
    near[3] = q[3] + 0.05
    found = follow(bent, q, given=[0], X=X, near=near)
    assert found.reached.tolist() == [True, False, False, True]
    assert found.start_unknown.tolist() == [False, False, True, False]
    assert np.abs(found.q_rad[3] - q[3]).max() < 1e-6


# Refusals and speed


def test_poses_for_seven_joints_are_refused_but_joints_are_not(seven):
    q = np.zeros((2, 7))
    assert follow(seven, q, given=[0, 1]).reached.all()
    with pytest.raises(InputError, match="six joints"):
        follow(seven, q, given=[0])


@pytest.mark.parametrize(
    ("change", "column"),
    [
        ({"previous": [-1, 2, 1]}, None),
        ({"previous": [-1, 3, 1]}, "previous"),
        ({"previous": [-2, 0, 1]}, "previous"),
        ({"previous": [-1, 0]}, "previous"),
        ({"near": np.full((3, 5), np.nan)}, "q_near_rad"),
        ({"near": np.array([[np.nan] * 5 + [1]] * 3)}, "q_near_rad"),
        ({"near": np.full((3, 6), np.inf)}, "q_near_rad"),
        ({"X": np.full((3, 4, 4), np.nan)}, "X"),
        ({"X": np.zeros((3, 3, 4))}, "X"),
        ({"start": np.full(6, np.nan)}, "q_start"),
        ({"start": np.zeros(5)}, "q_start"),
    ],
)
def test_what_does_not_go_together_is_refused(ur5, change, column):
    q = smooth(3)
    if column is None:
        assert follow(ur5, q, given=[0], **change).start_unknown.tolist() == [False, True, True]
        return
    with pytest.raises(InputError) as caught:
        follow(ur5, q, given=[0], **change)
    assert caught.value.column == column


@pytest.mark.parametrize("straight", [False, True])
def test_a_hundred_thousand_poses_take_about_a_second(ur5, straight):
    q = smooth(100_000)
    X = np.concatenate([nominal_flange_poses(ur5, part) for part in np.array_split(q, 100)])
    spent = []
    for _ in range(3):
        start = time.process_time()
        found = follow(ur5, q, given=[0], straight=straight, X=X)
        spent.append(time.process_time() - start)
    assert np.abs(found.q_rad - q).max() < 1e-7
    assert min(spent) < 2.0  # 0.4 and 0.8 s where nobody else is at work
