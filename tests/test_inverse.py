"""Inverse kinematics; whether a pose was reached is Drake's word."""

import numpy as np
import pytest
from drake_arm import DrakeArm, random_joints
from scipy.spatial.transform import Rotation
from truepath.errors import CorrectionError
from truepath.inverse import joints_along_path, solve
from truepath.model import nominal_model
from truepath.region import cover

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
WAYPOINTS = 120
LINES = np.arange(WAYPOINTS) + 2


@pytest.fixture(scope="module")
def drake():
    return DrakeArm("ur5")


@pytest.fixture(scope="module")
def forward(ur5):
    return nominal_model(ur5).flange_poses_and_jacobian


@pytest.fixture(scope="module")
def path():
    """Joints of a smooth path away from singularities."""
    s = np.linspace(0, 1, WAYPOINTS)[:, None]
    return HOME + s * [0.5, 0.3, -0.4, 0.2, 0.4, 0.6]


@pytest.fixture(scope="module")
def goals(drake, path):
    return drake.flange_poses(path)


@pytest.fixture(scope="module")
def region():
    """Joints that were measured, about the path."""
    return cover(HOME + np.random.default_rng(0).normal(scale=0.4, size=(200, 6)))


def misses(X, X_goal):
    """Largest position error in m and angle error in rad."""
    angle = Rotation.from_matrix(X[:, :3, :3] @ np.swapaxes(X_goal[:, :3, :3], 1, 2)).magnitude()
    return np.linalg.norm(X[:, :3, 3] - X_goal[:, :3, 3], axis=1).max(), angle.max()


# From a start that is near


def test_goals_are_reached_to_a_nanometre(drake, forward, goals, path):
    start = path + np.random.default_rng(1).normal(scale=0.02, size=path.shape)
    solution = solve(forward, goals, start)
    assert solution.converged.all()
    position, angle = misses(drake.flange_poses(solution.q_rad), goals)
    assert position < 2e-9
    assert angle < 2e-9


def test_the_solution_is_the_one_near_the_start(forward, goals, path):
    start = path + np.random.default_rng(2).normal(scale=0.02, size=path.shape)
    assert np.abs(solve(forward, goals, start).q_rad - path).max() < 1e-7


def test_a_start_at_the_goal_is_returned_bit_for_bit(forward, ur5, path):
    goals = forward(path)[0]
    assert np.array_equal(solve(forward, goals, path).q_rad, path)


def test_each_goal_is_solved_as_if_it_were_alone(forward, goals, path):
    start = path + 0.01
    together = solve(forward, goals, start)
    alone = [solve(forward, goals[k : k + 1], start[k : k + 1]).q_rad[0] for k in range(0, WAYPOINTS, 20)]
    assert np.array_equal(together.q_rad[::20], alone)


def test_a_goal_out_of_reach_does_not_converge_and_leaves_finite_numbers(forward, goals, path):
    far = goals.copy()
    far[3, :3, 3] += 3.0
    solution = solve(forward, far, path)
    assert np.flatnonzero(~solution.converged).tolist() == [3]
    assert solution.position_error_m[3] > 1.0
    assert np.isfinite(solution.q_rad).all()


def test_the_distance_to_a_singularity_is_that_of_drakes_jacobian(drake, forward, path):
    from pydrake.multibody.tree import JacobianWrtVariable

    q = np.array([HOME, [*HOME[:4], 0.0, 0.0]])  # the second with two wrist axes in line
    found = solve(forward, drake.flange_poses(q), q).smallest_singular_value
    world = drake.plant.world_frame()
    for k in range(2):
        drake.flange_poses(q[k])
        J = drake.plant.CalcJacobianSpatialVelocity(
            drake.context, JacobianWrtVariable.kV, drake.arm.flange, np.zeros(3), world, world
        )
        assert found[k] == pytest.approx(np.linalg.svd(J, compute_uv=False)[-1], abs=1e-12)
    assert found[0] > 0.1
    assert found[1] < 1e-12


def test_a_redundant_arm_takes_the_shortest_way(seven, seven_joint_arm):
    """Of all joints that reach the goal, the ones nearest to the start: nothing is moved in the null space."""
    forward = nominal_model(seven).flange_poses_and_jacobian
    start = random_joints(seven, 20, 0) * 0.5
    goals = forward(start)[0]
    goals[:, :3, 3] += [0.0005, -0.0003, 0.0002]
    solution = solve(forward, goals, start)
    assert solution.converged.all()
    assert max(misses(DrakeArm(seven_joint_arm).flange_poses(solution.q_rad), goals)) < 2e-9
    null = np.linalg.svd(forward(start)[1])[2][:, -1]
    step = solution.q_rad - start
    along = np.abs(np.einsum("ki,ki->k", null, step))
    assert (along < 0.02 * np.linalg.norm(step, axis=1) + 1e-9).all()


# Along a path of poses


def test_a_path_of_poses_is_followed_exactly(drake, ur5, goals, region):
    q = joints_along_path(ur5, goals, region, LINES, "poses.csv")
    position, angle = misses(drake.flange_poses(q), goals)
    assert position < 2e-9
    assert angle < 2e-9
    assert np.abs(np.diff(q, axis=0)).max() < 0.02


def test_the_posture_is_the_one_that_was_measured(ur5, goals, path, region):
    assert np.abs(joints_along_path(ur5, goals, region, LINES, "poses.csv") - path).max() < 1e-6


@pytest.mark.parametrize("turn", [0, -1])
def test_of_angles_a_whole_turn_apart_the_measured_one_is_taken(ur5, goals, path, turn):
    measured_about = np.array([*HOME[:5], 0.8 * 2 * np.pi * turn])
    region = cover(measured_about + np.random.default_rng(0).normal(scale=0.3, size=(200, 6)))
    q = joints_along_path(ur5, goals, region, LINES, "poses.csv")
    assert np.abs(q - path - [0, 0, 0, 0, 0, 2 * np.pi * turn]).max() < 1e-6
    assert ((q >= ur5.lower_rad) & (q <= ur5.upper_rad)).all()


def test_a_joint_that_would_run_into_its_limit_starts_a_whole_turn_away_from_it(drake, ur5, region):
    """Joint 6 turns once around: from 0.3 rad that ends beyond the limit of 2 pi."""
    q = np.tile(HOME, (400, 1))
    q[:, 5] = np.linspace(0.3, 0.3 + 2 * np.pi, 400)
    goals = drake.flange_poses(q)
    found = joints_along_path(ur5, goals, region, np.arange(400) + 2, "poses.csv")
    assert np.abs(found - (q - [0, 0, 0, 0, 0, 2 * np.pi])).max() < 1e-6


def test_a_path_for_which_a_joint_has_no_room_is_refused_where_the_last_posture_passes_the_limit(drake, ur5, region):
    """With the wrist flipped joint 6 starts half a turn lower, which takes it further but not far enough."""
    q = np.tile(HOME, (900, 1))
    q[:, 5] = np.linspace(0.3, 0.3 + 4.5 * np.pi, 900)
    with pytest.raises(CorrectionError, match="within the joint limits") as caught:
        joints_along_path(ur5, drake.flange_poses(q), region, np.arange(900) + 2, "poses.csv")
    assert caught.value.line == np.argmax(q[:, 5] - np.pi > 2 * np.pi) + 2
    assert caught.value.column == "q6 (wrist_3_joint)"


def test_a_first_waypoint_out_of_reach_is_refused_with_its_line(ur5, goals, region):
    far = goals.copy()
    far[:, 0, 3] += 5.0
    with pytest.raises(CorrectionError, match="first waypoint cannot be reached") as caught:
        joints_along_path(ur5, far, region, LINES, "poses.csv")
    assert caught.value.line == 2
    assert "poses.csv, line 2" in str(caught.value)


def test_a_later_waypoint_out_of_reach_is_refused_with_its_line(ur5, goals, region):
    far = goals.copy()
    far[70:, 0, 3] += 5.0
    with pytest.raises(CorrectionError, match="cannot be followed") as caught:
        joints_along_path(ur5, far, region, LINES, "poses.csv")
    assert caught.value.line == 72


def test_a_path_that_would_need_a_jump_of_a_joint_is_refused_at_the_jump(drake, ur5, path, region):
    path = path.copy()
    path[50:, 5] += 1.0
    with pytest.raises(CorrectionError, match="cannot be followed") as caught:
        joints_along_path(ur5, drake.flange_poses(path), region, LINES, "poses.csv")
    assert caught.value.line == 52


def test_a_seven_joint_arm_follows_a_path_of_poses_without_jumps(seven, seven_joint_arm):
    drake = DrakeArm(seven_joint_arm)
    programmed = 0.3 + np.linspace(0, 1, WAYPOINTS)[:, None] * [0.5, 0.3, -0.4, 0.2, 0.1, 0.6, 0.4]
    goals = drake.flange_poses(programmed)
    q = joints_along_path(seven, goals, cover(programmed), LINES, "poses.csv")
    assert max(misses(drake.flange_poses(q), goals)) < 2e-9
    assert np.abs(np.diff(q, axis=0)).max() < 0.03
