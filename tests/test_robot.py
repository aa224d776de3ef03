"""What is read out of a Drake plant, with Drake itself as the judge: kinematics, limits and gravity."""

import numpy as np
import pytest
from arm_judge import Judge, load, some_angles
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, SpatialInertia
from scipy.linalg import expm
from truepath.plants import load_plant, make_parser, models_dir
from truepath.robot import read_robot

ARMS = ("ur5", "ur10", "ur5 cell", "ur10 cell", "seven")


@pytest.fixture(scope="module")
def spec(seven_joint_arm):
    """Name of an arm to what ``load_plant`` takes, and the names of its model, base and flange."""
    cells = {f"{name} cell": models_dir() / name / "cell.dmd.yaml" for name in ("ur5", "ur10")}

    def spec(name):
        if name == "seven":
            return seven_joint_arm, "seven", "foot", "flange"
        return cells.get(name, name), name.split()[0], "base_link", "flange"

    return spec


@pytest.fixture(scope="module", params=ARMS)
def arm(request, spec):
    """The robot as truepath reads it, and Drake's view of the same plant."""
    source, *names = spec(request.param)
    plant = load_plant(source)
    return read_robot(plant), Judge(plant, *names)


def hat(xi):
    (wx, wy, wz), v = xi[:3], xi[3:]
    return np.array([[0, -wz, wy, v[0]], [wz, 0, -wx, v[1]], [-wy, wx, 0, v[2]], [0, 0, 0, 0]])


# Kinematics


def test_the_screws_are_the_columns_of_drakes_jacobian_of_the_base_origin_at_the_zero_pose(arm):
    robot, judge = arm
    judge.move(robot, np.zeros(robot.num_joints))
    p_FB = np.linalg.inv(judge.flange_pose())[:3, 3]  # the point of the moving flange that is now at the base
    J = judge.plant.CalcJacobianSpatialVelocity(
        judge.context, JacobianWrtVariable.kV, judge.flange, p_FB, judge.base, judge.base
    )
    columns = J[:, [joint.velocity_start() for joint in judge.joints(robot)]]
    np.testing.assert_allclose(robot.screws_B, columns.T, atol=1e-12)


def test_the_zero_pose_is_that_of_drake_whatever_the_default_posture(arm):
    robot, judge = arm
    judge.move(robot, np.zeros(robot.num_joints))
    np.testing.assert_allclose(robot.X_BF, judge.flange_pose(), atol=1e-12)


def test_screws_and_zero_pose_give_drakes_flange_pose_by_the_product_of_exponentials(arm):
    robot, judge = arm
    for q in some_angles(robot, 5):
        judge.move(robot, q)
        X = np.eye(4)
        for xi, angle in zip(robot.screws_B, q, strict=True):
            X = X @ expm(hat(xi) * angle)
        np.testing.assert_allclose(X @ robot.X_BF, judge.flange_pose(), atol=1e-12)


def test_axis_frames_are_proper_with_z_along_the_axis_their_origin_at_the_joint_and_x_towards_a_base_axis(arm):
    robot, judge = arm
    judge.move(robot, np.zeros(robot.num_joints))
    for X, joint in zip(robot.X_BA, judge.joints(robot), strict=True):
        X_BJ = joint.frame_on_parent().CalcPose(judge.context, judge.base).GetAsMatrix4()
        np.testing.assert_allclose(X[:3, 3], X_BJ[:3, 3], atol=1e-12)
        np.testing.assert_allclose(X[:3, 2], X_BJ[:3, :3] @ joint.revolute_axis(), atol=1e-12)
        np.testing.assert_allclose(X[:3, :3] @ X[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(X[:3, :3]) == pytest.approx(1)
        x, z = X[:3, 0], X[:3, 2]
        perpendicular = [e - z * (e @ z) for e in np.eye(3)[np.abs(z) < np.abs(z).min() + 1e-6]]
        assert any(np.allclose(x, v / np.linalg.norm(v), atol=1e-12) for v in perpendicular)


def test_joints_are_named_from_base_to_flange(seven, ur5):
    assert seven.joint_names == tuple(f"joint{i}" for i in range(1, 8))
    assert ur5.joint_names[0] == "shoulder_pan_joint"
    assert ur5.joint_names[-1] == "wrist_3_joint"


def test_limits_are_those_of_the_urdf(seven):
    np.testing.assert_array_equal(seven.lower_rad, [-2.9, -2.0, -2.8, -2.2, -2.6, -2.1, -3.0])
    np.testing.assert_array_equal(seven.upper_rad, [2.9, 2.1, 2.7, 2.3, 2.8, 2.0, 3.0])
    np.testing.assert_array_equal(seven.velocity_rad_s, [1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7])
    np.testing.assert_array_equal(seven.acceleration_rad_s2, [5.1, 5.2, 5.3, 5.4, 5.5, 5.6, 5.7])


def test_a_joint_without_limits_has_infinite_ones(seven_joint_urdf):
    limit = seven_joint_urdf[seven_joint_urdf.index("<limit") :]
    limit = limit[: limit.index("/>") + 2]
    text = seven_joint_urdf.replace(limit, "").replace('"joint1" type="revolute"', '"joint1" type="continuous"')
    robot = read_robot(load(text))
    for bounds in (robot.upper_rad, robot.velocity_rad_s, robot.acceleration_rad_s2):
        assert np.isposinf(bounds[0])
        assert np.isfinite(bounds[1:]).all()
    assert np.isneginf(robot.lower_rad[0])


def test_the_base_stands_where_the_model_puts_it(seven, spec):
    X_WB = RigidTransform(RollPitchYaw(0.5, -0.3, 1.1), [0.3, -0.2, 0.7]).GetAsMatrix4()
    np.testing.assert_allclose(seven.X_WB, X_WB, atol=1e-12)
    cell = read_robot(load_plant(spec("ur5 cell")[0]))
    np.testing.assert_allclose(cell.X_WB[:3, :3], np.diag([-1, -1, 1]), atol=1e-12)


def test_the_reflector_of_a_cell_is_found_on_the_flange_and_a_bare_robot_has_none(ur5, spec):
    assert ur5.X_FR is None
    plant = load_plant(spec("ur5 cell")[0])
    judge = Judge(plant, "ur5", "base_link", "flange")
    expected = plant.GetFrameByName("reflector").CalcPose(judge.context, judge.flange).GetAsMatrix4()
    assert np.linalg.norm(expected[:3, 3]) > 0.03
    np.testing.assert_allclose(read_robot(plant).X_FR, expected, atol=1e-12)


# Gravity


def test_gravity_torque_is_that_of_drake(arm):
    robot, judge = arm
    q = some_angles(robot)
    torque = robot.gravity_torque(q)
    assert torque.shape == q.shape
    assert np.abs(torque).max() > 5  # or the next line proves nothing
    for row, expected in zip(q, torque, strict=True):
        judge.move(robot, row)
        np.testing.assert_allclose(expected, judge.gravity_torque(robot), atol=1e-9)


@pytest.mark.parametrize("name", ["ur10 cell", "seven"])
def test_a_payload_acts_like_a_point_mass_that_drake_has_welded_to_the_flange(spec, name):
    source, instance, base, flange = spec(name)
    p_FP, kg = np.array([0.03, -0.07, 0.2]), 4.5
    plant = MultibodyPlant(0.0)
    make_parser(plant).AddModels(str(source))
    ball = SpatialInertia.SolidSphereWithMass(kg, 0.01)
    load = plant.AddRigidBody("payload", plant.AddModelInstance("payload"), ball)
    on_flange = plant.GetFrameByName(flange, plant.GetModelInstanceByName(instance))
    plant.WeldFrames(on_flange, load.body_frame(), RigidTransform(p_FP))
    plant.Finalize()
    judge = Judge(plant, instance, base, flange)

    bare, loaded = read_robot(load_plant(source)), read_robot(plant)
    q = some_angles(bare, 6)
    kgs = np.array([0, kg, 0, kg, kg, 0])
    with_payload = bare.gravity_torque(q, kgs, p_FP)
    for row, mass, torque in zip(q, kgs, with_payload, strict=True):
        judge.move(loaded, row)
        expected = judge.gravity_torque(loaded) if mass else bare.gravity_torque(row)[0]
        np.testing.assert_allclose(torque, expected, atol=1e-9)
    # And as a part of the model it is felt without being asked for.
    np.testing.assert_allclose(loaded.gravity_torque(q), bare.gravity_torque(q, kg, p_FP), atol=1e-9)


def test_a_payload_sits_at_the_flange_origin_unless_stated_otherwise(ur5):
    q = some_angles(ur5, 4)
    np.testing.assert_array_equal(ur5.gravity_torque(q, 2.0), ur5.gravity_torque(q, 2.0, np.zeros(3)))
    assert not np.allclose(ur5.gravity_torque(q, 2.0), ur5.gravity_torque(q))


def test_a_single_posture_may_be_given_without_its_batch_axis(ur5):
    q = some_angles(ur5, 1)
    np.testing.assert_array_equal(ur5.gravity_torque(q[0]), ur5.gravity_torque(q))


def test_gravity_hangs_on_how_the_base_is_mounted(seven):
    g = 9.81
    R_WB = RollPitchYaw(0.5, -0.3, 1.1).ToRotationMatrix().matrix()
    np.testing.assert_allclose(seven.gravity_B, R_WB.T @ [0, 0, -g], atol=1e-12)
