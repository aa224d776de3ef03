"""The robot models are those that Universal Robots has published, and any reader finds the same."""

import re

import numpy as np
import pytest
import yourdfpy
from drawn_cell import HALF_PI, HOME, MODELS, ROBOTS
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

# Published by Universal Robots; typed here a second time, on purpose.
JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
LINKS = (
    "shoulder_link",
    "upper_arm_link",
    "forearm_link",
    "wrist_1_link",
    "wrist_2_link",
    "wrist_3_link",
)
ALPHA = (HALF_PI, 0, 0, HALF_PI, -HALF_PI, 0)
A = {"ur5": (0, -0.425, -0.39225, 0, 0, 0), "ur10": (0, -0.612, -0.5723, 0, 0, 0)}
D = {
    "ur5": (0.089159, 0, 0, 0.10915, 0.09465, 0.0823),
    "ur10": (0.1273, 0, 0, 0.163941, 0.1157, 0.0922),
}
MASS = {
    "ur5": (3.7, 8.393, 2.275, 1.219, 1.219, 0.1879),
    "ur10": (7.1, 12.7, 4.27, 2.0, 2.0, 0.365),
}
CENTRE_OF_MASS = {  # in the frame at the end of DH row i
    "ur5": (
        (0, -0.02561, 0.00193),
        (0.2125, 0, 0.11336),
        (0.15, 0, 0.0265),
        (0, -0.0018, 0.01634),
        (0, 0.0018, 0.01634),
        (0, 0, -0.001159),
    ),
    "ur10": (
        (0.021, 0, 0.027),
        (0.38, 0, 0.158),
        (0.24, 0, 0.068),
        (0, 0.007, 0.018),
        (0, 0.007, 0.018),
        (0, 0, -0.026),
    ),
}
DATA_SHEET_MASS = {"ur5": 18.4, "ur10": 28.9}
SPEED = {"ur5": (np.pi,) * 6, "ur10": (2 * np.pi / 3,) * 2 + (np.pi,) * 4}
EFFORT = {"ur5": (150,) * 3 + (28,) * 3, "ur10": (330, 330, 150, 54, 54, 54)}


def dh_frames(robot: str, q: np.ndarray) -> list[np.ndarray]:
    """T_1 ... T_i for i = 1 ... 6, from the table alone."""
    frames, pose = [], np.eye(4)
    for theta, d, a, alpha in zip(q, D[robot], A[robot], ALPHA, strict=True):
        ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        pose = pose @ np.array(
            [
                [ct, -st * ca, st * sa, a * ct],
                [st, ct * ca, -ct * sa, a * st],
                [0, sa, ca, d],
                [0, 0, 0, 1],
            ]
        )
        frames.append(pose)
    return frames


@pytest.fixture(params=ROBOTS)
def robot(request) -> str:
    return request.param


def urdf_plant(robot: str) -> MultibodyPlant:
    """The robot alone, its base welded to the world."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.SetStrictParsing()
    parser.AddModels(str(MODELS / robot / f"{robot}.urdf"))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    plant.Finalize()
    return plant


def test_flange_pose_is_the_product_of_the_dh_table(robot):
    plant = urdf_plant(robot)
    context = plant.CreateDefaultContext()
    flange = plant.GetFrameByName("flange")
    for q in np.random.default_rng(1).uniform(-2 * np.pi, 2 * np.pi, (200, 6)):
        plant.SetPositions(context, q)
        actual = flange.CalcPoseInWorld(context).GetAsMatrix4()
        np.testing.assert_allclose(actual, dh_frames(robot, q)[-1], rtol=0, atol=1e-9)


def test_joints_are_those_of_a_ur_in_order_and_turn_about_z(robot):
    plant = urdf_plant(robot)
    for index, name in enumerate(JOINTS):
        joint = plant.GetJointByName(name)
        assert joint.position_start() == index
        np.testing.assert_array_equal(joint.revolute_axis(), [0, 0, 1])


def test_limits_are_those_of_the_data_sheet(robot):
    plant = urdf_plant(robot)
    np.testing.assert_allclose(plant.GetPositionUpperLimits(), [2 * np.pi] * 6)
    np.testing.assert_allclose(plant.GetPositionLowerLimits(), [-2 * np.pi] * 6)
    np.testing.assert_allclose(plant.GetVelocityUpperLimits(), SPEED[robot])
    np.testing.assert_allclose(plant.GetEffortUpperLimits(), EFFORT[robot])
    assert np.all(np.isfinite(plant.GetAccelerationUpperLimits()))


def test_masses_are_those_published_and_add_up_to_the_data_sheet(robot):
    plant = urdf_plant(robot)
    context = plant.CreateDefaultContext()
    masses = [plant.GetBodyByName(link).default_mass() for link in LINKS]
    np.testing.assert_allclose(masses, MASS[robot])
    assert plant.CalcTotalMass(context) == pytest.approx(DATA_SHEET_MASS[robot])


def test_centres_of_mass_lie_where_published(robot):
    plant = urdf_plant(robot)
    context = plant.CreateDefaultContext()
    q = np.array([0.3, -1.1, 0.8, -0.4, 1.3, 2.0])
    plant.SetPositions(context, q)
    for link, row, p in zip(LINKS, dh_frames(robot, q), CENTRE_OF_MASS[robot], strict=True):
        body = plant.GetBodyByName(link)
        p_local = body.CalcSpatialInertiaInBodyFrame(context).get_com()
        actual = body.EvalPoseInWorld(context).multiply(p_local)
        np.testing.assert_allclose(actual, (row @ [*p, 1])[:3], rtol=0, atol=1e-9)


def test_urdf_needs_no_other_file(robot):
    text = (MODELS / robot / f"{robot}.urdf").read_text(encoding="utf-8")
    assert not re.search(r"<mesh|package:|file:", text)


@pytest.mark.filterwarnings("ignore:.*Scene.dump:DeprecationWarning")
def test_yourdfpy_reads_the_same_robot(robot):
    urdf = yourdfpy.URDF.load(str(MODELS / robot / f"{robot}.urdf"), build_collision_scene_graph=True)
    assert tuple(urdf.actuated_joint_names) == JOINTS
    urdf.update_cfg(HOME)
    np.testing.assert_allclose(
        urdf.get_transform("flange", "base_link"),
        dh_frames(robot, HOME)[-1],
        atol=1e-6,
    )
