"""Which arm of a Drake plant is read, between which frames, and what is no arm."""

import numpy as np
import pytest
from arm_judge import Judge, load, some_angles
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame
from truepath.errors import InputError
from truepath.plants import make_parser, models_dir
from truepath.robot import read_robot

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


def test_a_prismatic_joint_in_the_chain_is_refused_by_name(seven_joint_urdf):
    plant = load(seven_joint_urdf.replace('"joint5" type="revolute"', '"joint5" type="prismatic"'))
    with pytest.raises(InputError, match="joint 'joint5' is of a type that truepath does not calibrate") as caught:
        read_robot(plant)
    assert caught.value.found == "prismatic"


def test_a_prismatic_joint_beside_the_chain_does_no_harm(seven_joint_urdf, seven):
    text = seven_joint_urdf.replace('"counterweight_mount" type="fixed"', '"counterweight_mount" type="prismatic"')
    robot = read_robot(load(text))
    assert robot.model_sha256 == seven.model_sha256
    np.testing.assert_allclose(robot.gravity_torque(np.ones(7)), seven.gravity_torque(np.ones(7)), atol=1e-9)


def test_a_rail_below_the_base_is_no_part_of_the_arm(seven_joint_urdf, seven):
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


def test_base_and_flange_may_be_other_frames_of_the_model(seven_joint_urdf, seven):
    plant = load(seven_joint_urdf)
    part = read_robot(plant, base_frame="link2", flange_frame="bracket6")
    assert part.joint_names == ("joint3", "joint4", "joint5", "joint6")
    context = plant.CreateDefaultContext()
    X = plant.GetFrameByName("bracket6").CalcPose(context, plant.GetFrameByName("link2"))
    np.testing.assert_allclose(part.X_BF, X.GetAsMatrix4(), atol=1e-12)


def test_a_tool_frame_added_by_a_host_program_may_be_the_flange(seven_joint_urdf, seven):
    X_FT = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [0.01, 0.02, 0.3])

    def add_tool(plant):
        plant.AddFrame(FixedOffsetFrame("my_tool", plant.GetFrameByName("flange"), X_FT))

    robot = read_robot(load(seven_joint_urdf, add_tool), flange_frame="my_tool")
    np.testing.assert_allclose(robot.X_BF, seven.X_BF @ X_FT.GetAsMatrix4(), atol=1e-12)


def test_without_a_frame_that_is_called_flange_the_single_end_of_the_chain_is_taken(seven_joint_urdf, seven):
    text = seven_joint_urdf.replace('"flange"', '"gripper"').replace(
        '<parent link="link3"/><child link="counterweight"/>', '<parent link="gripper"/><child link="counterweight"/>'
    )
    assert read_robot(load(text)).num_joints == 7


def test_without_such_a_frame_two_ends_are_refused_by_name(seven_joint_urdf):
    with pytest.raises(InputError, match="cannot tell which body carries the tool") as caught:
        read_robot(load(seven_joint_urdf.replace('"flange"', '"gripper"')))
    assert caught.value.found == "counterweight, gripper"


@pytest.mark.parametrize("argument", ["base_frame", "flange_frame"])
def test_an_unknown_frame_is_refused_and_the_known_ones_are_told(seven_joint_urdf, argument):
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


def test_a_flange_that_does_not_hang_on_the_base_is_refused(seven_joint_urdf):
    with pytest.raises(InputError, match="'link2' does not hang on frame 'link5'"):
        read_robot(load(seven_joint_urdf), base_frame="link5", flange_frame="link2")


def test_a_single_joint_is_no_arm(seven_joint_urdf):
    with pytest.raises(InputError, match="is no arm"):
        read_robot(load(seven_joint_urdf), base_frame="foot", flange_frame="link1")
