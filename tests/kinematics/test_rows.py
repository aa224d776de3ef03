"""Chain, effects, turns and inverses on rows, against Drake, scipy and what the package computes pose by pose."""

import casadi as ca
import numpy as np
import pytest
from deviated_plant import DeviatedPlant
from drake_arm import random_joints
from every_effect import afflicted, every_effect
from scipy.spatial.transform import Rotation
from truepath.context import Context
from truepath.effects import joint_errors, probe_shift
from truepath.kinematics import small_turns
from truepath.kinematics.arm_rows import ArmRows
from truepath.kinematics.chain_rows import ChainRows
from truepath.kinematics.effect_rows import EffectPrograms, EffectRows
from truepath.kinematics.gravity import gravity_moments
from truepath.kinematics.inverse_rows import InverseRows
from truepath.model import nominal_flange_poses
from truepath.motions import ChainPoses, Moves
from truepath.plants import load_plant

N = 60


@pytest.fixture(params=["ur5", "ur10", "seven"])
def robot(request):
    return request.getfixturevalue(request.param)


def waves(angles):
    return np.stack([np.sin(angles), np.cos(angles)])


def some_deviation(robot):
    n = robot.num_joints
    return np.concatenate([1e-2 * np.random.default_rng(3).uniform(-1, 1, 4 * n), np.zeros(12)])


# The chain


@pytest.mark.parametrize("name", ["ur5", "seven"])
def test_the_flange_of_a_deviated_arm_is_where_drake_has_it(name, request, seven_joint_arm):
    robot = request.getfixturevalue(name)
    p, q = some_deviation(robot), random_joints(robot, 12, 0)
    drake = DeviatedPlant(robot, load_plant("ur5" if name == "ur5" else seven_joint_arm), p)
    chain = ChainRows(robot, p, 12)
    chain(waves(q.T + chain.offset[:, None]))
    expected = np.array([drake.flange_pose(joints) for joints in q])
    np.testing.assert_allclose(chain.frame.transpose(2, 1, 0), expected[:, :3], atol=1e-12)


def test_the_flange_of_the_drawing_is_where_it_should_be(robot):
    """Right angles and zeros are left out; those of each robot are others."""
    q = random_joints(robot, N, 0)
    chain = ChainRows(robot, np.zeros(4 * robot.num_joints + 12), N)
    chain(waves(q.T + chain.offset[:, None]))
    np.testing.assert_allclose(chain.frame.transpose(2, 1, 0), nominal_flange_poses(robot, q)[:, :3], atol=1e-14)


# Effects


def effect_rows(robot, effects, q, payload_kg=2.0, turn=None):
    turn = np.zeros(robot.num_joints) if turn is None else turn
    rows = EffectRows(EffectPrograms(robot, effects, payload_kg, turn), len(q))
    rows.angles[...] = np.concatenate([q.T, *waves(q.T)])
    rows()
    return rows


@pytest.mark.parametrize("upper_rad", [4.0, 0.3])  # the second fades, and is silent, at many of the poses
def test_joints_err_as_they_do_pose_by_pose(robot, upper_rad):
    q = random_joints(robot, 700, 1)
    effects = every_effect(robot.num_joints, upper_rad=upper_rad)
    expected = joint_errors(robot, Context(q, payload_kg=2.0), effects)
    assert np.abs(expected).max() > 1e-4
    np.testing.assert_allclose(effect_rows(robot, effects, q).motions[:, 0].T, expected, atol=2e-15)


def test_what_axes_carry_moves_as_it_does_pose_by_pose(robot):
    q, p = random_joints(robot, N, 2), some_deviation(robot)
    effects = every_effect(robot.num_joints)
    chain = ChainRows(robot, p, N)
    rows = effect_rows(robot, effects, q, turn=chain.turn)
    chain(waves(q.T + chain.offset[:, None]), rows.programs.moved_axes, rows.motions)
    poses = ChainPoses.of(robot, p, q, np.eye(4), np.eye(4))
    expected = probe_shift(robot, Context(q), effects, poses, (Moves.AXIS,))
    assert np.abs(expected).max() > 1e-4
    moved = chain.sway.T + np.cross(chain.tilt.T, poses.X_MF[:, :3, 3])
    np.testing.assert_allclose(moved, expected[:, :3], atol=1e-16)
    np.testing.assert_allclose(chain.tilt.T, expected[:, 3:], atol=1e-16)


def test_loads_are_those_of_the_robot_with_its_payload(robot):
    q, n = random_joints(robot, N, 3), robot.num_joints
    sin, cos = ca.SX.sym("sin", n), ca.SX.sym("cos", n)
    moments = ca.Function("moments", [sin, cos], [ca.horzcat(*gravity_moments(robot, sin, cos, 3.0)).T])
    found = np.array([moments(np.sin(row), np.cos(row)) for row in q])
    np.testing.assert_allclose(found, robot.gravity_moment(q, 3.0), atol=1e-12)


def test_lengths_grow_as_on_the_last_day_of_the_campaign(ur5):
    """2e-5 per K, five degrees warmer than the reference."""
    assert EffectPrograms(ur5, every_effect(6), 0.0, np.zeros(6)).strain == pytest.approx(1e-4, rel=1e-12)


# Turns


def test_sines_of_angles_that_change_a_little():
    rng = np.random.default_rng(0)
    angle, change = rng.uniform(-3, 3, (6, N)), rng.uniform(-0.1, 0.1, (6, N))
    out = np.empty((2, 6, N))
    small_turns.turn_on(waves(angle), change, out, np.empty((3, 6, N)))
    np.testing.assert_allclose(out, waves(angle + change), atol=1e-15)
    small_turns.turn_on(waves(angle), 0.0 * change, out, np.empty((3, 6, N)))
    assert np.array_equal(out, waves(angle))


def columns(rotation):
    return np.ascontiguousarray(rotation.as_matrix().transpose(2, 1, 0))


def test_small_turns_are_those_of_scipy():
    rng = np.random.default_rng(1)
    start = Rotation.random(N, rng=rng)
    first, second = (Rotation.from_rotvec(rng.normal(scale=4e-3, size=(N, 3))) for _ in range(2))
    v, trace = small_turns.between(columns(second * first * start), columns(start))
    np.testing.assert_allclose(small_turns.rotation_vector(v).T, (second * first).as_rotvec(), atol=1e-15)
    np.testing.assert_allclose(trace, np.trace((second * first).as_matrix(), axis1=1, axis2=2), atol=1e-14)
    w = small_turns.from_rotation_vector(first.as_rotvec().T)
    np.testing.assert_allclose(small_turns.rotation_vector(small_turns.without(v, w)).T, second.as_rotvec(), atol=1e-15)
    point = rng.normal(size=(N, 3))
    np.testing.assert_allclose(small_turns.turned_by(w, point.T).T, first.apply(point) - point, atol=1e-15)


def test_a_turn_that_is_not_small_shows_in_its_trace():
    half_turn = Rotation.from_rotvec(np.pi * np.eye(3))
    start = Rotation.identity(3)
    assert (small_turns.between(columns(half_turn * start), columns(start))[1] < 0).all()


# Inverses


def test_inverses_and_a_bound_of_the_smallest_singular_value():
    columns = np.random.default_rng(2).normal(size=(6, 6, N))
    matrices = columns.transpose(2, 1, 0)
    inverses = InverseRows(N)
    condition = np.linalg.cond(matrices)
    found = inverses.of(columns).transpose(2, 0, 1)
    truth = np.linalg.inv(matrices)
    relative = np.linalg.norm(found - truth, axis=(1, 2)) / np.linalg.norm(truth, axis=(1, 2))
    assert (relative < 1e-6 * condition).all()
    smallest = np.linalg.svd(matrices, compute_uv=False)[:, -1]
    share = inverses.least_singular_value() / smallest
    assert (share <= 1 + 1e-6 * condition).all()
    assert (share >= 0.99 / np.sqrt(6)).all()


# The whole arm


def test_the_jacobian_is_that_of_the_rigid_robot_at_its_true_angles(robot):
    model, q = afflicted(robot), random_joints(robot, N, 4)
    arm = ArmRows(model, N)
    arm.start(q)
    arm.at(None)
    expected = model.flange_poses_and_jacobian(q)[1]
    np.testing.assert_allclose(arm.jacobian().transpose(2, 1, 0), expected, atol=2e-7)  # in single precision
