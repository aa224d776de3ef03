"""The product of exponentials with deviations: Drake judges the kinematics, finite differences the derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from deviated_plant import DeviatedPlant, pose, step
from pydrake.multibody.tree import JacobianWrtVariable
from scipy.spatial.transform import Rotation
from truepath import poe
from truepath.measurements import Measurements
from truepath.plants import load_plant
from truepath.poe_symbolic import PoseProblem

ARMS = ("ur5", "seven")


@pytest.fixture(params=ARMS)
def robot(request):
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="module")
def plants(seven_joint_arm):
    """A plant of each arm, by the name of its robot."""
    return {"ur5": load_plant("ur5"), "seven": load_plant(seven_joint_arm)}


def some_angles(robot, count, seed=1):
    return np.random.default_rng(seed).uniform(-2, 2, (count, robot.num_joints))


def some_deviation(robot, seed=2):
    """Far larger than a real robot's, so that second-order mistakes show: 10 mm, 20 mrad; frames 0.1 m, 0.3 rad."""
    size = {("axis", "m"): 0.01, ("axis", "rad"): 0.02, ("frame", "m"): 0.1, ("frame", "rad"): 0.3}
    names = poe.parameter_names(robot.num_joints)
    sizes = [size["axis" if name.group == "axis" else "frame", name.unit] for name in names]
    return np.array(sizes) * np.random.default_rng(seed).uniform(-1, 1, len(names))


# The parameters


def test_parameters_are_named_axis_by_axis_then_base_then_tool():
    names = [str(name) for name in poe.parameter_names(6)]
    frame = ["pos_x", "pos_y", "pos_z", "rot_x", "rot_y", "rot_z"]
    assert names[:5] == ["axis1.pos_x", "axis1.pos_y", "axis1.rot_x", "axis1.rot_y", "axis2.pos_x"]
    assert names[23] == "axis6.rot_y"
    assert names[24:] == [f"base.{f}" for f in frame] + [f"tool.{f}" for f in frame]


@pytest.mark.parametrize("n", [2, 6, 7])
def test_there_are_four_parameters_an_axis_and_six_a_frame_and_the_slices_find_the_frames(n):
    names = poe.parameter_names(n)
    assert len(names) == 4 * n + 12
    assert {name.group for name in names[poe.base_slice(n)]} == {"base"}
    assert {name.group for name in names[poe.tool_slice(n)]} == {"tool"}
    assert len(names[poe.base_slice(n)]) == len(names[poe.tool_slice(n)]) == 6


def test_joints_count_from_one_and_frames_belong_to_none():
    names = poe.parameter_names(3)
    assert [name.joint for name in names] == [1] * 4 + [2] * 4 + [3] * 4 + [None] * 12


def test_shifts_are_in_metres_and_turns_in_radians():
    assert {(name.field[:3], name.unit) for name in poe.parameter_names(6)} == {("pos", "m"), ("rot", "rad")}


def test_a_step_shifts_and_then_turns_about_x_y_z():
    np.testing.assert_allclose(
        poe.frame_step(np.array([1, 2, 3, 0.3, -0.4, 0.5])), step(1, 2, 3, 0.3, -0.4, 0.5), atol=1e-15
    )


# Kinematics, judged by Drake


def test_without_deviation_the_flange_is_where_drake_has_it(robot, plants):
    plant, q = plants[robot.name], some_angles(robot, 30)
    X_BF = poe.flange_poses(robot, np.zeros(4 * robot.num_joints + 12), q)
    context = plant.CreateDefaultContext()
    flange = plant.GetFrameByName("flange")
    base = plant.GetBodyByName({"ur5": "base_link", "seven": "foot"}[robot.name]).body_frame()
    for row, X in zip(q, X_BF, strict=True):
        plant.SetPositions(context, row)
        np.testing.assert_allclose(X, flange.CalcPose(context, base).GetAsMatrix4(), atol=1e-12)


def test_deviated_axes_move_the_flange_as_in_a_drake_plant_with_deviated_joint_frames(robot, plants):
    p, q = some_deviation(robot), some_angles(robot, 30)
    judge = DeviatedPlant(robot, plants[robot.name], p)
    X_BF = poe.flange_poses(robot, p, q)
    moved = np.linalg.norm((X_BF - poe.flange_poses(robot, 0 * p, q))[:, :3, 3], axis=1)
    assert moved.min() > 1e-3
    for row, X in zip(q, X_BF, strict=True):
        np.testing.assert_allclose(X, judge.flange_pose(row), atol=1e-9)


def test_each_single_deviation_moves_the_flange_as_in_drake(robot, plants):
    q = some_angles(robot, 2)
    for k in range(4 * robot.num_joints):
        p = np.zeros(4 * robot.num_joints + 12)
        p[k] = 0.05
        judge = DeviatedPlant(robot, plants[robot.name], p)
        for row, X in zip(q, poe.flange_poses(robot, p, q), strict=True):
            np.testing.assert_allclose(X, judge.flange_pose(row), atol=1e-9)


def test_at_the_zero_pose_deviated_axes_move_nothing(robot):
    X_BF = poe.flange_poses(robot, some_deviation(robot), np.zeros((1, robot.num_joints)))
    np.testing.assert_allclose(X_BF[0], robot.X_BF, atol=1e-12)


def test_the_steps_of_base_and_tool_are_no_part_of_the_robot(robot):
    p, q = some_deviation(robot), some_angles(robot, 3)
    axes_only = np.concatenate([p[: 4 * robot.num_joints], np.zeros(12)])
    np.testing.assert_array_equal(poe.flange_poses(robot, p, q), poe.flange_poses(robot, axes_only, q))


def test_turning_an_axis_frame_about_its_axis_or_sliding_it_along_changes_nothing(robot):
    q, nothing = some_angles(robot, 5), np.zeros(4 * robot.num_joints + 12)
    slid = robot.X_BA @ np.stack([step(pos_z=0.1 * i, rot_z=0.7 * i) for i in range(robot.num_joints)])
    np.testing.assert_allclose(
        poe.flange_poses(replace(robot, X_BA=slid), nothing, q), poe.flange_poses(robot, nothing, q), atol=1e-12
    )


def test_a_batch_gives_what_its_rows_give_one_by_one(robot):
    p, q = some_deviation(robot), some_angles(robot, 4)
    one_by_one = np.concatenate([poe.flange_poses(robot, p, row) for row in q])
    np.testing.assert_allclose(poe.flange_poses(robot, p, q), one_by_one, atol=1e-15)


def test_no_pose_at_all_is_a_batch_too(robot):
    assert poe.flange_poses(robot, some_deviation(robot), np.zeros((0, robot.num_joints))).shape == (0, 4, 4)


def test_calibrated_axes_are_the_nominal_ones_moved_by_their_own_deviation(robot):
    p = some_deviation(robot)
    for i, X in enumerate(poe.calibrated_axes(robot, p)):
        px, py, rx, ry = p[4 * i : 4 * i + 4]
        np.testing.assert_allclose(X, robot.X_BA[i] @ step(px, py, 0, rx, ry, 0), atol=1e-14)


def test_links_lead_from_axis_to_axis_and_multiply_to_the_zero_pose(robot):
    links = poe.link_transforms(robot.X_BA, robot.X_BF)
    assert links.shape == (robot.num_joints + 1, 4, 4)
    X = np.eye(4)
    for link, axis in zip(links, robot.X_BA, strict=False):
        X = X @ link
        np.testing.assert_allclose(X, axis, atol=1e-12)
    np.testing.assert_allclose(X @ links[-1], robot.X_BF, atol=1e-12)


# Derivatives


def twist_between(X_before, X_after, dt):
    """Angular and linear velocity, seen from the base."""
    turn = Rotation.from_matrix(X_after[:3, :3] @ X_before[:3, :3].T).as_rotvec()
    return np.concatenate([turn, X_after[:3, 3] - X_before[:3, 3]]) / dt


def test_the_jacobian_is_that_of_drake_where_nothing_deviates(robot, plants):
    plant, q = plants[robot.name], some_angles(robot, 10)
    context, flange = plant.CreateDefaultContext(), plant.GetFrameByName("flange")
    base = plant.GetFrameByName({"ur5": "base_link", "seven": "foot"}[robot.name])
    J = poe.flange_poses_and_jacobian(robot, np.zeros(4 * robot.num_joints + 12), q)[1]
    assert J.shape == (10, 6, robot.num_joints)
    for row, mine in zip(q, J, strict=True):
        plant.SetPositions(context, row)
        drakes = plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kV, flange, np.zeros(3), base, base)
        np.testing.assert_allclose(mine, drakes, atol=1e-12)


def test_the_jacobian_of_a_deviated_robot_agrees_with_finite_differences(robot):
    p, q, h = some_deviation(robot), some_angles(robot, 5), 1e-6
    X_BF, J = poe.flange_poses_and_jacobian(robot, p, q)
    np.testing.assert_array_equal(X_BF, poe.flange_poses(robot, p, q))
    for i, e in enumerate(np.eye(robot.num_joints)):
        before, after = poe.flange_poses(robot, p, q - h * e), poe.flange_poses(robot, p, q + h * e)
        for k in range(len(q)):
            np.testing.assert_allclose(J[k, :, i], twist_between(before[k], after[k], 2 * h), atol=1e-8)


# The calibration problem: the same model as a CasADi expression


class Setting:
    """Measurements of a deviated robot, off by some centimetres and half a radian, and a p to evaluate at."""

    def __init__(self, robot, has_orientation):
        rng = np.random.default_rng(7)
        N = 8
        self.robot, self.has_orientation = robot, has_orientation
        self.X_MB = pose(Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix(), [3.0, -1.0, 0.5])
        self.X_FE = pose(Rotation.from_rotvec([-0.7, 0.2, 0.9]).as_matrix(), [0.05, -0.02, 0.13])
        self.q, self.p = some_angles(robot, N), some_deviation(robot)
        X_ME = self.predicted(np.zeros_like(self.p))
        self.p_ME = X_ME[:, :3, 3] + 0.05 * rng.normal(size=(N, 3))
        self.R_ME = Rotation.from_rotvec(0.5 * rng.normal(size=(N, 3))).as_matrix() @ X_ME[:, :3, :3]
        self.measurements = Measurements(q_rad=self.q, p_ME=self.p_ME, R_ME=self.R_ME if has_orientation else None)
        self.problem = PoseProblem(robot, self.measurements, self.X_MB, self.X_FE)

    def predicted(self, p):
        n = self.robot.num_joints
        base, tool = step(*p[4 * n : 4 * n + 6]), step(*p[4 * n + 6 :])
        return self.X_MB @ base @ poe.flange_poses(self.robot, p, self.q) @ self.X_FE @ tool

    def residual(self, p):
        """Predicted minus measured: m, and rotation vectors shortened from a to 2 sin(a/2)."""
        X = self.predicted(p)
        position = X[:, :3, 3] - self.p_ME
        if not self.has_orientation:
            return position
        vector = Rotation.from_matrix(X[:, :3, :3] @ np.swapaxes(self.R_ME, 1, 2)).as_rotvec()
        angle = np.linalg.norm(vector, axis=1, keepdims=True)
        return np.concatenate([position, vector * 2 * np.sin(angle / 2) / angle], axis=1)


@pytest.fixture(params=[False, True], ids=["3D", "6D"])
def setting(robot, request):
    return Setting(robot, request.param)


def test_the_residual_is_predicted_minus_measured(setting):
    residual, _ = setting.problem.evaluate(setting.p)
    assert residual.shape == (8, 6 if setting.has_orientation else 3)
    np.testing.assert_allclose(residual, setting.residual(setting.p), atol=1e-12)


def test_the_jacobian_of_the_residual_agrees_with_finite_differences(setting):
    _, J = setting.problem.evaluate(setting.p)
    names, h = poe.parameter_names(setting.robot.num_joints), 1e-6
    for k, e in enumerate(h * np.eye(len(setting.p))):
        slope = (setting.residual(setting.p + e) - setting.residual(setting.p - e)) / (2 * h)
        np.testing.assert_allclose(J[:, :, k], slope, atol=2e-8, err_msg=str(names[k]))


def test_the_jacobian_is_right_at_the_start_of_a_fit_too(setting):
    start = np.zeros_like(setting.p)
    _, J = setting.problem.evaluate(start)
    h = 1e-6
    for k, e in enumerate(np.eye(len(start))):
        slope = (setting.residual(h * e) - setting.residual(-h * e)) / (2 * h)
        np.testing.assert_allclose(J[:, :, k], slope, atol=2e-8)


def test_a_perfect_robot_measured_without_error_leaves_no_residual(robot):
    setting = Setting(robot, True)
    X = setting.predicted(setting.p)
    exact = Measurements(q_rad=setting.q, p_ME=X[:, :3, 3], R_ME=X[:, :3, :3])
    residual, _ = PoseProblem(robot, exact, setting.X_MB, setting.X_FE).evaluate(setting.p)
    np.testing.assert_allclose(residual, 0, atol=1e-12)


def test_evaluating_again_does_not_change_what_was_returned_before(setting):
    first = [part.copy() for part in setting.problem.evaluate(setting.p)]
    kept = setting.problem.evaluate(setting.p)
    setting.problem.evaluate(np.zeros_like(setting.p))
    for mine, theirs in zip(first, kept, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_two_problems_of_one_kind_do_not_disturb_each_other(robot):
    one = Setting(robot, True)
    expected = one.problem.evaluate(one.p)[0]
    X = one.predicted(one.p)
    other = PoseProblem(robot, Measurements(q_rad=one.q, p_ME=X[:, :3, 3], R_ME=X[:, :3, :3]), one.X_MB, one.X_FE)
    np.testing.assert_allclose(other.evaluate(one.p)[0], 0, atol=1e-12)
    np.testing.assert_array_equal(one.problem.evaluate(one.p)[0], expected)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.0, np.pi - 1e-3, np.pi])
def test_the_orientation_residual_stays_finite_and_monotone_up_to_half_a_turn(ur5, angle):
    setting = Setting(ur5, True)
    nothing = np.zeros_like(setting.p)
    X = setting.predicted(nothing)
    axis = np.array([0.6, 0.0, 0.8])
    R = Rotation.from_rotvec(-angle * axis).as_matrix() @ X[:, :3, :3]
    data = Measurements(q_rad=setting.q, p_ME=X[:, :3, 3], R_ME=R)
    residual, J = PoseProblem(ur5, data, setting.X_MB, setting.X_FE).evaluate(nothing)
    assert np.isfinite(J).all()
    if angle < np.pi:
        np.testing.assert_allclose(residual[:, 3:], np.tile(2 * np.sin(angle / 2) * axis, (8, 1)), atol=1e-9)
    else:
        assert np.isfinite(residual).all()
