"""Where an arm ends in a model that goes on: grippers whose joints are no joints of the arm."""

import re

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, SpatialInertia
from truepath import plants
from truepath.arm import locate_arm
from truepath.errors import InputError
from truepath.host import CalibrationPlugin
from truepath.robot import describe_arm

FLANGE = re.compile(r'\s*<link name="flange"/>\s*<joint name="flange_joint".*?</joint>', re.DOTALL)
LINK = """<link name="{}"><inertial><mass value="0.1"/>
<inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>"""
JOINT = """<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><origin xyz="0 0.02 0.05"/>
<axis xyz="1 0 0"/><limit lower="{}" upper="{}" velocity="1" effort="1"/></joint>"""
PALM = (
    LINK.format("palm")
    + '<joint name="palm_mount" type="fixed"><parent link="wrist_3_link"/><child link="palm"/></joint>'
)


def gripper(*fingers):
    """A palm on the last link, and fingers: name, type and range of their joints."""
    parts = [PALM]
    for name, kind, upper in fingers:
        parts += [LINK.format(f"{name}_link"), JOINT.format(name, kind, "palm", f"{name}_link", 0.0, upper)]
    return "".join(parts)


def plant_with(added, flange=False):
    """A UR5 with something added to its model; with the frame that is called flange, or without."""
    text = plants.resolve("ur5").read_text()
    text = (text if flange else FLANGE.sub("", text)).replace("</robot>", added + "</robot>")
    plant = MultibodyPlant(0.0)
    (arm,) = plants.make_parser(plant).AddModelsFromString(text, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link", arm))
    if added:
        plant.AddFrame(FixedOffsetFrame("tcp", plant.GetFrameByName("palm"), RigidTransform([0, 0, 0.1]), arm))
    plant.Finalize()
    return plant


ONE_FINGER = gripper(("finger_joint", "revolute", 0.8))
FINGERS = {
    "a revolute finger": ONE_FINGER,
    "a finger that slides": gripper(("finger_joint", "prismatic", 0.04)),
    "two fingers": gripper(("left_finger", "revolute", 0.8), ("right_finger", "revolute", 0.8)),
    "a joint of another name that hardly turns": gripper(("drive", "revolute", 0.8)),
    "a knuckle that turns far": gripper(("outer_knuckle_joint", "revolute", 3.0)),
}


@pytest.mark.parametrize("name", FINGERS)
def test_a_gripper_is_not_taken_for_the_arm_and_the_refusal_says_what_to_state(name):
    with pytest.raises(InputError) as caught:
        locate_arm(plant_with(FINGERS[name]))
    for word in ("flange_frame", "tool_frame"):
        assert word in caught.value.expected


def test_the_refusal_names_the_joints_beyond_and_the_link_before_them():
    with pytest.raises(InputError, match="look like those of a gripper: 'finger_joint'") as caught:
        locate_arm(plant_with(ONE_FINGER))
    assert "flange_frame='wrist_3_link'" in caught.value.expected
    with pytest.raises(InputError, match="joint 'finger_joint' is of a type") as caught:
        locate_arm(plant_with(FINGERS["a finger that slides"]))
    assert "flange_frame='palm'" in caught.value.expected
    assert caught.value.found == "prismatic"


@pytest.mark.parametrize("stated", [{"flange_frame": "wrist_3_link"}, {"flange_frame": "palm"}, {"carried": "tcp"}])
@pytest.mark.parametrize("name", FINGERS)
def test_where_the_end_is_stated_the_arm_ends_there(name, stated):
    plant = plant_with(FINGERS[name])
    arm = locate_arm(plant, **stated)
    assert [joint.name() for joint in arm.joints][-1] == "wrist_3_joint"
    assert len(arm.joints) == 6
    assert arm.flange.name() == stated.get("flange_frame", "wrist_3_link")


@pytest.mark.parametrize("name", FINGERS)
def test_a_frame_that_is_called_flange_ends_the_arm(name, ur5):
    plant = plant_with(FINGERS[name], flange=True)
    arm = locate_arm(plant)
    assert arm.flange.name() == "flange"
    robot = describe_arm(plant, arm)
    assert robot.model_sha256 == ur5.model_sha256
    assert robot.link_mass_kg[-1] > ur5.link_mass_kg[-1] + 0.19  # the gripper is carried all the same


def test_a_plugin_whose_tool_is_on_the_palm_works_on_six_joints():
    plant = plant_with(ONE_FINGER)
    plugin = CalibrationPlugin(plant, tool_frame="tcp")
    assert plugin.arm.tolist() == [plant.GetJointByName(name).position_start() for name in plugin.robot.joint_names]
    assert plugin.robot.num_joints == 6
    assert np.allclose(plugin.place.X_FT[:3, 3], [0, 0, 0.1])
    assert CalibrationPlugin(plant, tool_frame=plant.GetFrameByName("tcp")).robot.num_joints == 6
    assert CalibrationPlugin(plant, flange_frame="palm").robot.num_joints == 6


def test_a_joint_that_hardly_turns_can_be_stated_to_be_one_of_the_arm():
    plant = plant_with(FINGERS["a joint of another name that hardly turns"])
    assert len(locate_arm(plant, flange_frame="drive_link").joints) == 7


def test_without_a_gripper_the_end_of_the_model_stays_the_flange_also_with_a_tool():
    """As the command line reads it, which knows of no tool frame."""
    mount = (
        LINK.format("mount") + '<joint name="m" type="fixed"><parent link="wrist_3_link"/><child link="mount"/></joint>'
    )
    text = FLANGE.sub("", plants.resolve("ur5").read_text()).replace("</robot>", mount + "</robot>")
    plant = MultibodyPlant(0.0)
    (arm,) = plants.make_parser(plant).AddModelsFromString(text, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link", arm))
    pen = plant.AddRigidBody("pen", plant.AddModelInstance("pen"), SpatialInertia.SolidCubeWithDensity(500.0, 0.05))
    plant.WeldFrames(plant.GetFrameByName("mount"), pen.body_frame())
    plant.Finalize()
    assert locate_arm(plant, carried="pen").flange.name() == locate_arm(plant).flange.name() == "mount"
