"""The calibrated kinematics in other hands: a URDF and a plant's context, both judged by Drake.

The truth is a plant whose joint frames were moved by hand; the calibration that describes it is made of
the same numbers by its own definition (truepath.poe), not fitted.
"""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from drake_arm import DrakeArm, random_joints
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial.transform import Rotation
from truepath import plants
from truepath.errors import InputError
from truepath.export import set_calibrated_frames, write_calibrated_urdf
from truepath.model import nominal_model

ROBOTS = ("ur5", "ur10", "seven")


@pytest.fixture
def robot(request):
    return request.getfixturevalue(request.param)


@pytest.fixture
def urdf(robot, seven_joint_arm):
    return seven_joint_arm if robot.num_joints == 7 else plants.resolve(robot.name)


def deviating(robot, seed=0):
    """A calibration with 0.4 mm and 0.6 mrad of deviation in every axis."""
    p = np.zeros(4 * robot.num_joints + 12)
    p[: 4 * robot.num_joints] = np.random.default_rng(seed).normal(scale=[4e-4, 4e-4, 6e-4, 6e-4] * robot.num_joints)
    return replace(nominal_model(robot), p=p)


def poses_by_exponentials(model, q):
    """``(4, 4)`` exp(xi_1 q_1) ... exp(xi_n q_n) M, every axis line moved as the parameters say; plain and slow."""
    robot = model.robot
    X = np.eye(4)
    for i, angle in enumerate(q):
        x, y, rx, ry = model.p[4 * i : 4 * i + 4]
        R, origin = robot.X_BA[i][:3, :3], robot.X_BA[i][:3, 3]
        point = origin + R @ [x, y, 0.0]
        direction = R @ Rotation.from_euler("XYZ", [rx, ry, 0.0]).as_matrix()[:, 2]
        turn = Rotation.from_rotvec(angle * direction).as_matrix()
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = turn, point - turn @ point
        X = X @ step
    return X @ robot.X_BF


def two_arms(first="ur5", second="ur5"):
    """A finalized plant: one arm on the floor, another on a tilted stand; not the world's axes for either."""
    plant = MultibodyPlant(0.0)
    instances = []
    for name, spec in (("left", first), ("right", second)):
        parser = plants.make_parser(plant)
        parser.SetAutoRenaming(True)
        (instance,) = parser.AddModels(str(plants.resolve(spec)))
        shift = 0.0 if name == "left" else 1.5
        X = RigidTransform(RollPitchYaw(0.3, -0.2 - shift, 2.0), [shift, 0.4, 0.7])
        base = plant.GetBodyByName("base_link", instance)
        mount = plant.AddFrame(FixedOffsetFrame(f"mount_{name}", plant.world_frame(), X))
        plant.WeldFrames(mount, base.body_frame())
        instances.append(instance)
    plant.Finalize()
    return plant, instances


def pose_in_base(plant, context, instance, q):
    plant.SetPositions(context, instance, q)
    flange, base = plant.GetFrameByName("flange", instance), plant.GetFrameByName("base_link", instance)
    return flange.CalcPose(context, base).GetAsMatrix4()


# A URDF


@pytest.mark.parametrize("robot", ROBOTS, indirect=True)
def test_drake_loads_the_urdf_and_its_kinematics_are_the_calibrated_ones(robot, urdf, tmp_path):
    model = deviating(robot)
    write_calibrated_urdf(model, urdf, tmp_path / "calibrated.urdf")
    arm, q = DrakeArm(tmp_path / "calibrated.urdf"), random_joints(robot, 20, 0)
    expected = np.array([poses_by_exponentials(model, joints) for joints in q])
    assert np.abs(arm.flange_poses(q) - expected).max() < 1e-9
    assert np.abs(DrakeArm(urdf).flange_poses(q) - expected).max() > 1e-4


@pytest.mark.parametrize("robot", ROBOTS, indirect=True)
def test_without_deviations_the_urdf_is_the_nominal_robot(robot, urdf, tmp_path):
    write_calibrated_urdf(nominal_model(robot), urdf, tmp_path / "same.urdf")
    assert plants.load_robot(tmp_path / "same.urdf").model_sha256 == robot.model_sha256


@pytest.mark.parametrize("robot", ROBOTS, indirect=True)
def test_limits_masses_and_names_are_kept(robot, urdf, tmp_path):
    write_calibrated_urdf(deviating(robot), urdf, tmp_path / "calibrated.urdf")
    written = plants.load_robot(tmp_path / "calibrated.urdf")
    assert written.joint_names == robot.joint_names
    assert written.name == robot.name
    for name in ("lower_rad", "upper_rad", "velocity_rad_s", "acceleration_rad_s2", "link_mass_kg"):
        assert np.array_equal(getattr(written, name), getattr(robot, name)), name


def test_shapes_to_see_and_to_collide_with_are_kept(ur5, tmp_path):
    write_calibrated_urdf(deviating(ur5), plants.resolve("ur5"), tmp_path / "calibrated.urdf")

    def shapes(spec):
        plant, scene_graph = plants.add_cell(DiagramBuilder(), spec)
        inspector = scene_graph.model_inspector()
        return [
            (inspector.GetName(g), type(inspector.GetShape(g)).__name__, len(inspector.GetCollisionCandidates()))
            for body in plant.GetBodyIndices(plant.GetModelInstanceByName("ur5"))
            for g in inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(body))
        ]

    written, original = shapes(tmp_path / "calibrated.urdf"), shapes("ur5")
    assert len(original) > 10
    assert [shape[1:] for shape in written] == [shape[1:] for shape in original]


def test_only_origins_of_the_chain_differ_from_the_nominal_urdf(ur5, tmp_path):
    write_calibrated_urdf(deviating(ur5), plants.resolve("ur5"), tmp_path / "calibrated.urdf")

    def joints(path):
        return {
            joint.get("name"): {
                "type": joint.get("type"),
                "links": (joint.find("parent").get("link"), joint.find("child").get("link")),
                "axis": None if joint.find("axis") is None else np.fromstring(joint.find("axis").get("xyz"), sep=" "),
                "xyz": np.fromstring(joint.find("origin").get("xyz"), sep=" "),
            }
            for joint in ElementTree.parse(path).getroot().iterfind("joint")
        }

    nominal, written = joints(plants.resolve("ur5")), joints(tmp_path / "calibrated.urdf")
    assert list(nominal) == list(written)
    for name, joint in nominal.items():
        assert written[name]["type"] == joint["type"]
        assert written[name]["links"] == joint["links"]
        if joint["type"] == "revolute":
            assert np.array_equal(written[name]["axis"], joint["axis"])
            assert 0 < np.abs(written[name]["xyz"] - joint["xyz"]).max() < 0.003


def test_a_urdf_of_another_robot_is_refused_and_nothing_is_written(ur5, seven_joint_arm, tmp_path):
    with pytest.raises(InputError, match="not that of the calibrated robot"):
        write_calibrated_urdf(deviating(ur5), seven_joint_arm, tmp_path / "calibrated.urdf")
    with pytest.raises(InputError, match="flange"):  # the same joint names, other lengths
        write_calibrated_urdf(deviating(ur5), plants.resolve("ur10"), tmp_path / "calibrated.urdf")
    assert list(tmp_path.iterdir()) == []


# A host's plant


@pytest.mark.parametrize("robot", ROBOTS, indirect=True)
def test_the_frames_of_a_context_carry_the_calibrated_kinematics(robot, urdf):
    model, arm, q = deviating(robot), DrakeArm(urdf), random_joints(robot, 20, 1)
    set_calibrated_frames(model, arm.plant, arm.context)
    expected = np.array([poses_by_exponentials(model, joints) for joints in q])
    assert np.abs(arm.flange_poses(q) - expected).max() < 1e-9


def test_in_a_whole_cell_the_tool_moves_along_with_the_calibrated_flange(ur5):
    plant, _ = plants.add_cell(DiagramBuilder(), "ur5_cell")
    model, q = deviating(ur5), random_joints(ur5, 5, 2)
    context = plant.CreateDefaultContext()
    base, reflector, flange = (plant.GetFrameByName(name) for name in ("base_link", "reflector", "flange"))
    nominal_mount = reflector.CalcPose(context, flange).GetAsMatrix4()
    set_calibrated_frames(model, plant, context)
    for joints in q:
        plant.SetPositions(context, joints)
        expected = poses_by_exponentials(model, joints) @ nominal_mount
        assert np.abs(reflector.CalcPose(context, base).GetAsMatrix4() - expected).max() < 1e-9


def test_of_two_arms_on_turned_bases_only_the_one_meant_moves(ur5):
    plant, (left, right) = two_arms()
    model, q = deviating(ur5), random_joints(ur5, 5, 3)
    context = plant.CreateDefaultContext()
    before = [pose_in_base(plant, context, left, joints) for joints in q]
    set_calibrated_frames(model, plant, context, model_instance=right)
    for joints, nominal in zip(q, before, strict=True):
        assert np.abs(pose_in_base(plant, context, right, joints) - poses_by_exponentials(model, joints)).max() < 1e-9
        assert np.array_equal(pose_in_base(plant, context, left, joints), nominal)


def test_both_arms_can_carry_their_own_calibration_in_one_context(ur5, ur10):
    plant, (left, right) = two_arms("ur5", "ur10")
    models = {left: deviating(ur5, 1), right: deviating(ur10, 2)}
    context = plant.CreateDefaultContext()
    for instance, model in models.items():
        set_calibrated_frames(model, plant, context, model_instance=instance)
    q = random_joints(ur5, 1, 4)[0]
    for instance, model in models.items():
        assert np.abs(pose_in_base(plant, context, instance, q) - poses_by_exponentials(model, q)).max() < 1e-9


def test_other_contexts_and_the_joints_stay_as_they_are(ur5):
    arm, q = DrakeArm("ur5"), random_joints(ur5, 1, 5)
    other = arm.plant.CreateDefaultContext()
    arm.plant.SetPositions(other, q[0])
    arm.plant.SetPositions(arm.context, q[0])
    before = arm.arm.flange.CalcPose(other, arm.arm.base).GetAsMatrix4()
    set_calibrated_frames(deviating(ur5), arm.plant, arm.context)
    assert np.array_equal(arm.plant.GetPositions(arm.context), q[0])
    for context in (other, arm.plant.CreateDefaultContext()):
        arm.plant.SetPositions(context, q[0])
        assert np.array_equal(arm.arm.flange.CalcPose(context, arm.arm.base).GetAsMatrix4(), before)


def test_setting_frames_twice_is_setting_them_once_and_a_perfect_robot_sets_them_back(ur5):
    arm, q = DrakeArm("ur5"), random_joints(ur5, 5, 6)
    nominal = arm.flange_poses(q)
    set_calibrated_frames(deviating(ur5), arm.plant, arm.context)
    once = arm.flange_poses(q)
    set_calibrated_frames(deviating(ur5), arm.plant, arm.context)
    assert np.abs(arm.flange_poses(q) - once).max() < 1e-12
    set_calibrated_frames(nominal_model(ur5), arm.plant, arm.context)
    assert np.abs(arm.flange_poses(q) - nominal).max() < 1e-12


def test_a_plant_with_another_robot_is_refused(ur5):
    arm = DrakeArm("ur10")
    with pytest.raises(InputError, match="not the calibrated robot") as caught:
        set_calibrated_frames(deviating(ur5), arm.plant, arm.context)
    assert "ur5" in caught.value.expected
    assert "ur10" in caught.value.found


def test_where_the_arm_is_not_clear_it_must_be_stated(ur5):
    plant, _ = two_arms()
    with pytest.raises(InputError, match="which model in the plant is the arm"):
        set_calibrated_frames(deviating(ur5), plant, plant.CreateDefaultContext())
