"""What is read out of a Drake plant, with Drake itself as the judge."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, JacobianWrtVariable, SpatialInertia
from scipy.linalg import expm
from truepath.errors import InputError
from truepath.plants import load_plant, make_parser, models_dir
from truepath.robot import read_robot

ARMS = ("ur5", "ur10", "ur5 cell", "ur10 cell", "seven")


class Judge:
    """One arm in one Drake plant, and the questions that the tests ask of Drake."""

    def __init__(self, plant, instance_name, base, flange):
        self.plant, self.context = plant, plant.CreateDefaultContext()
        self.instance = plant.GetModelInstanceByName(instance_name)
        self.base, self.flange = (plant.GetFrameByName(name, self.instance) for name in (base, flange))

    def joints(self, robot):
        return [self.plant.GetJointByName(name, self.instance) for name in robot.joint_names]

    def move(self, robot, q):
        for joint, angle in zip(self.joints(robot), q, strict=True):
            joint.set_angle(self.context, angle)

    def flange_pose(self):
        return self.flange.CalcPose(self.context, self.base).GetAsMatrix4()

    def gravity_torque(self, robot):
        forces = self.plant.CalcGravityGeneralizedForces(self.context)
        return np.array([forces[joint.velocity_start()] for joint in self.joints(robot)])


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


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    """A finalized plant from the text of a URDF, and before that whatever a test wants to add."""

    def load(text, prepare=lambda plant: None):
        path = tmp_path_factory.mktemp("urdf") / "robot.urdf"
        path.write_text(text)
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(str(path))
        prepare(plant)
        plant.Finalize()
        return plant

    return load


def some_angles(robot, count=20):
    rng = np.random.default_rng(5)
    low, high = np.maximum(robot.lower_rad, -np.pi), np.minimum(robot.upper_rad, np.pi)
    return rng.uniform(low, high, (count, robot.num_joints))


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


def test_a_joint_without_limits_has_infinite_ones(load, seven_joint_urdf):
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


# The hash of the nominal model


def test_the_hash_does_not_depend_on_where_the_robot_stands(load, seven_joint_urdf, seven, ur5, spec):
    stand = 'xyz="0.3 -0.2 0.7" rpy="0.5 -0.3 1.1"'
    for elsewhere in ('xyz="0 0 0" rpy="0 0 0"', 'xyz="-12.3 4.5 6.7" rpy="1 2 3"', 'xyz="1e3 0 0" rpy="-3 0.1 0"'):
        moved = read_robot(load(seven_joint_urdf.replace(stand, elsewhere)))
        assert not np.allclose(moved.X_WB, seven.X_WB)
        assert moved.model_sha256 == seven.model_sha256
    assert read_robot(load_plant(spec("ur5 cell")[0])).model_sha256 == ur5.model_sha256


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('xyz="0.04 -0.03 0.19"', 'xyz="0.04 -0.03001 0.19"'),  # a link, 10 um
        ('rpy="0.4 0.3 -0.6"', 'rpy="0.4 0.3 -0.60001"'),  # a joint, 10 urad
        ('axis xyz="0 -1 0"', 'axis xyz="0 1 0"'),  # a sense of rotation
        ('rpy="0.3 -0.2 0.4"', 'rpy="0.3 -0.2 0.401"'),  # a bracket between two joints
        ('xyz="0.02 -0.01 0.09"', 'xyz="0.02 -0.01 0.0901"'),  # the flange
        ('"joint5"', '"joint_5"'),  # a name
    ],
)
def test_the_hash_changes_with_the_geometry_and_with_the_names_of_the_joints(load, seven_joint_urdf, seven, old, new):
    assert old in seven_joint_urdf
    assert read_robot(load(seven_joint_urdf.replace(old, new))).model_sha256 != seven.model_sha256


def test_the_hash_does_not_change_with_masses_or_limits(load, seven_joint_urdf, seven):
    text = seven_joint_urdf.replace('<mass value="3.1"/>', '<mass value="9"/>').replace('upper="2.1"', 'upper="2.05"')
    other = read_robot(load(text))
    assert other.link_mass_kg[0] != seven.link_mass_kg[0]
    assert other.upper_rad[1] != seven.upper_rad[1]
    assert other.model_sha256 == seven.model_sha256


def test_the_hash_does_not_change_with_noise_far_below_a_nanometre(seven):
    noise = 1e-13 * np.random.default_rng(0).normal(size=(7, 4, 4))
    assert replace(seven, X_BA=seven.X_BA + noise, X_BF=seven.X_BF - noise[0]).model_sha256 == seven.model_sha256


def test_the_hash_tells_the_built_in_robots_apart(ur5, ur10, seven):
    assert len({ur5.model_sha256, ur10.model_sha256, seven.model_sha256}) == 3


# Plants with more than one arm, or with none


@pytest.fixture(scope="module")
def two_arms(seven_joint_arm):
    """A UR5 and the seven-joint arm; the UR5 hangs from the ceiling."""
    plant = MultibodyPlant(0.0)
    parser = make_parser(plant)
    ur5 = parser.AddModels(str(models_dir() / "ur5" / "ur5.urdf"))[0]
    seven = parser.AddModels(str(seven_joint_arm))[0]
    X_WB = RigidTransform(RollPitchYaw(np.pi, 0, 0.4), [0.5, 0, 2])
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link", ur5), X_WB)
    plant.Finalize()
    return plant, ur5, seven


def test_of_two_arms_the_one_is_read_that_is_asked_for(two_arms, ur5, seven):
    plant, *instances = two_arms
    for instance, alone, base in zip(instances, (ur5, seven), ("base_link", "foot"), strict=True):
        robot = read_robot(plant, model_instance=instance)
        assert (robot.name, robot.joint_names) == (alone.name, alone.joint_names)
        assert robot.model_sha256 == alone.model_sha256
        np.testing.assert_allclose(robot.link_mass_kg, alone.link_mass_kg, rtol=1e-12)
        judge = Judge(plant, alone.name, base, "flange")
        for q in some_angles(robot, 4):
            judge.move(robot, q)
            np.testing.assert_allclose(robot.gravity_torque(q)[0], judge.gravity_torque(robot), atol=1e-9)


def test_two_arms_are_refused_by_name_where_nobody_says_which(two_arms):
    with pytest.raises(InputError) as caught:
        read_robot(two_arms[0])
    assert caught.value.problem == "cannot tell which model in the plant is the arm"
    assert caught.value.found == "ur5, seven"
    assert "model_instance given" in caught.value.expected


def test_a_plant_without_an_arm_is_refused():
    plant = MultibodyPlant(0.0)
    make_parser(plant).AddModels(str(models_dir() / "cell" / "table.urdf"))
    plant.Finalize()
    with pytest.raises(InputError, match="cannot tell which model in the plant is the arm") as caught:
        read_robot(plant)
    assert caught.value.found == "no revolute joint"


def test_an_unfinalized_plant_is_refused(seven_joint_arm):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(seven_joint_arm))
    with pytest.raises(InputError, match="the plant is not finalized"):
        read_robot(plant)


def test_a_prismatic_joint_in_the_chain_is_refused_by_name(load, seven_joint_urdf):
    plant = load(seven_joint_urdf.replace('"joint5" type="revolute"', '"joint5" type="prismatic"'))
    with pytest.raises(InputError, match="joint 'joint5' is of a type that truepath does not calibrate") as caught:
        read_robot(plant)
    assert caught.value.found == "prismatic"


def test_a_prismatic_joint_beside_the_chain_does_no_harm(load, seven_joint_urdf, seven):
    text = seven_joint_urdf.replace('"counterweight_mount" type="fixed"', '"counterweight_mount" type="prismatic"')
    robot = read_robot(load(text))
    assert robot.model_sha256 == seven.model_sha256
    np.testing.assert_allclose(robot.gravity_torque(np.ones(7)), seven.gravity_torque(np.ones(7)), atol=1e-9)


def test_a_rail_below_the_base_is_no_part_of_the_arm(load, seven_joint_urdf, seven):
    robot = read_robot(
        load(
            seven_joint_urdf.replace('<link name="world"/>', '<link name="world"/><link name="carriage"/>')
            .replace('<parent link="world"/>', '<parent link="carriage"/>')
            .replace(
                "</robot>",
                '<joint name="rail" type="prismatic"><parent link="world"/><child link="carriage"/></joint></robot>',
            )
        ),
        base_frame="foot",
    )
    assert robot.model_sha256 == seven.model_sha256


# Base and flange of one's own choice


def test_base_and_flange_may_be_other_frames_of_the_model(load, seven_joint_urdf, seven):
    plant = load(seven_joint_urdf)
    part = read_robot(plant, base_frame="link2", flange_frame="bracket6")
    assert part.joint_names == ("joint3", "joint4", "joint5", "joint6")
    context = plant.CreateDefaultContext()
    X = plant.GetFrameByName("bracket6").CalcPose(context, plant.GetFrameByName("link2"))
    np.testing.assert_allclose(part.X_BF, X.GetAsMatrix4(), atol=1e-12)


def test_a_tool_frame_added_by_a_host_program_may_be_the_flange(load, seven_joint_urdf, seven):
    X_FT = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [0.01, 0.02, 0.3])

    def add_tool(plant):
        plant.AddFrame(FixedOffsetFrame("my_tool", plant.GetFrameByName("flange"), X_FT))

    robot = read_robot(load(seven_joint_urdf, add_tool), flange_frame="my_tool")
    np.testing.assert_allclose(robot.X_BF, seven.X_BF @ X_FT.GetAsMatrix4(), atol=1e-12)


def test_without_a_frame_that_is_called_flange_the_single_end_of_the_chain_is_taken(load, seven_joint_urdf, seven):
    text = seven_joint_urdf.replace('"flange"', '"gripper"').replace(
        '<parent link="link3"/><child link="counterweight"/>', '<parent link="gripper"/><child link="counterweight"/>'
    )
    assert read_robot(load(text)).num_joints == 7


def test_without_such_a_frame_two_ends_are_refused_by_name(load, seven_joint_urdf):
    with pytest.raises(InputError, match="cannot tell which body carries the tool") as caught:
        read_robot(load(seven_joint_urdf.replace('"flange"', '"gripper"')))
    assert caught.value.found == "counterweight, gripper"


@pytest.mark.parametrize("argument", ["base_frame", "flange_frame"])
def test_an_unknown_frame_is_refused_and_the_known_ones_are_told(load, seven_joint_urdf, argument):
    with pytest.raises(InputError, match="no frame called 'flansch'") as caught:
        read_robot(load(seven_joint_urdf), **{argument: "flansch"})
    assert "flange" in caught.value.expected


@pytest.mark.parametrize("argument", ["base_frame", "flange_frame"])
def test_a_frame_name_that_several_other_models_have_is_refused(seven_joint_arm, argument):
    plant = MultibodyPlant(0.0)
    parser = make_parser(plant)
    parser.SetAutoRenaming(True)
    for path in (seven_joint_arm, *2 * [models_dir() / "cell" / "tool.urdf"]):
        parser.AddModels(str(path))
    plant.Finalize()
    with pytest.raises(InputError, match="tool_tip"):
        read_robot(plant, **{argument: "tool_tip"})


def test_a_flange_that_does_not_hang_on_the_base_is_refused(load, seven_joint_urdf):
    with pytest.raises(InputError, match="'link2' does not hang on frame 'link5'"):
        read_robot(load(seven_joint_urdf), base_frame="link5", flange_frame="link2")


def test_a_single_joint_is_no_arm(load, seven_joint_urdf):
    with pytest.raises(InputError, match="is no arm"):
        read_robot(load(seven_joint_urdf), base_frame="foot", flange_frame="link1")
