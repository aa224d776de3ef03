"""What the robot models, the cells and the example programs promise."""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import DiagramBuilder

MODELS = Path(__file__).parents[1] / "models"
ROBOTS = ("ur5", "ur10")
HALF_PI = np.pi / 2
HOME = np.array([0, -HALF_PI, HALF_PI, -HALF_PI, -HALF_PI, 0])

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


@dataclass
class Cell:
    """A cell with one context, and the questions that the tests ask of it."""

    robot: str

    def __post_init__(self):
        builder = DiagramBuilder()
        self.plant, self.scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        parser = Parser(self.plant)
        parser.SetStrictParsing()
        parser.package_map().Add("truepath_models", str(MODELS))
        parser.AddModels(str(MODELS / self.robot / "cell.dmd.yaml"))
        self.plant.Finalize()
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)

    def pose(self, frame: str, q=None, relative_to: str = "world") -> RigidTransform:
        """Pose of a frame, at q or where the robot stands now."""
        if q is not None:
            self.plant.SetPositions(self.context, q)
        reference = self.plant.GetFrameByName(relative_to)
        return self.plant.GetFrameByName(frame).CalcPose(self.context, reference)

    def flange_jacobian(self, q) -> np.ndarray:
        """Rotation over translation, 6 x 6, in base_link."""
        self.plant.SetPositions(self.context, q)
        base = self.plant.GetFrameByName("base_link")
        return self.plant.CalcJacobianSpatialVelocity(
            self.context,
            JacobianWrtVariable.kQDot,
            self.plant.GetFrameByName("flange"),
            np.zeros(3),
            base,
            base,
        )

    def collisions(self, q) -> set[tuple[str, str]]:
        """Names of the shapes that penetrate each other at q."""
        self.plant.SetPositions(self.context, q)
        query = self.scene_graph.get_query_output_port().Eval(self.scene_graph.GetMyContextFromRoot(self.root))
        name = self.scene_graph.model_inspector().GetName
        return {(name(pair.id_A), name(pair.id_B)) for pair in query.ComputePointPairPenetration()}


@pytest.fixture(scope="module", params=ROBOTS)
def cell(request) -> Cell:
    return Cell(request.param)


@pytest.fixture(scope="module")
def ur5_cell() -> Cell:
    return Cell("ur5")


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


def read_columns(path: Path, columns: list[str]) -> tuple[list[str], np.ndarray]:
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        assert reader.fieldnames == ["label", *columns]
        rows = list(reader)
    return [row["label"] for row in rows], np.array([[float(row[column]) for column in columns] for row in rows])


def read_weld_path(robot: str) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Labels, joints in rad, speeds in mm/s."""
    columns = [f"q{i}_rad" for i in range(1, 7)] + ["speed_mm_s"]
    labels, values = read_columns(MODELS / robot / "weld_path.csv", columns)
    return labels, values[:, :6], values[:, 6]


def between(waypoints: np.ndarray, steps: int) -> np.ndarray:
    """The waypoints and the joint-space motion between them."""
    fractions = np.arange(steps) / steps
    legs = waypoints[:-1, None] + fractions[:, None] * np.diff(waypoints, axis=0)[:, None]
    return np.vstack([legs.reshape(-1, waypoints.shape[1]), waypoints[-1:]])


# --- the robots -----------------------------------------------------------------------


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


def test_ordinary_postures_are_free_of_collision(cell):
    postures = [
        HOME,
        [0, -HALF_PI, 0, -HALF_PI, 0, 0],  # upright
        [0, -HALF_PI, HALF_PI, -HALF_PI, 0, 0],
        [0, -HALF_PI, HALF_PI, -HALF_PI, np.pi, 0],
        [1.0, -1.9, 1.7, -1.4, -HALF_PI, 0.5],
        [0, -2.2, 2.2, -HALF_PI, -HALF_PI, 0],
        [0, -1.0, -1.5, -0.6, HALF_PI, 0],  # elbow down
        [3.0, -HALF_PI, 1.2, -1.0, 1.5, 2.0],  # to the rear
    ]
    for q in postures:
        assert cell.collisions(np.array(q)) == set(), q


def test_a_real_collision_is_seen(cell):
    level_arm_in_the_table = np.zeros(6)
    folded_arm = np.array([0, -HALF_PI, 3.0, 0, 0, 0])
    assert "table" in str(cell.collisions(level_arm_in_the_table))
    own = f"{cell.robot}::"
    assert any(a.startswith(own) and b.startswith(own) for a, b in cell.collisions(folded_arm))


# --- the cells ------------------------------------------------------------------------


def test_cell_has_its_model_instances_and_six_degrees_of_freedom(cell):
    assert cell.plant.num_positions() == 6
    for name in (cell.robot, "pedestal", "table", "tool"):
        assert cell.plant.HasModelInstanceNamed(name)


def test_cell_package_is_found_by_its_package_xml():
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddPackageXml(str(MODELS / "package.xml"))
    assert parser.package_map().GetPath("truepath_models") == str(MODELS)


def test_cell_starts_at_home_over_the_table(cell):
    default = cell.plant.GetPositions(cell.plant.CreateDefaultContext())
    np.testing.assert_allclose(default, HOME, atol=1e-12)
    tip = cell.pose("tool_tip", HOME, relative_to="workpiece")
    np.testing.assert_allclose(tip.rotation().matrix()[:, 2], [0, 0, -1], atol=1e-12)
    assert 0.1 < tip.translation()[2] < 0.6


def test_robot_stands_on_the_pedestal(cell):
    np.testing.assert_allclose(cell.pose("base_link").translation(), [0, 0, 0.6])
    base, mount = cell.pose("base_link"), cell.pose("robot_mount")
    assert base.IsNearlyEqualTo(mount, 1e-12)


def test_reflector_sits_31_mm_before_the_flange(cell):
    pose = cell.pose("reflector", HOME, relative_to="flange")
    assert pose.IsNearlyEqualTo(RigidTransform([-0.07, 0, 0.031]), 1e-12)


def test_moving_the_mount_in_a_context_moves_the_robot(cell):
    mount = cell.plant.GetFrameByName("robot_mount")
    before = cell.pose("flange", HOME)
    nominal = mount.GetPoseInParentFrame(cell.context)
    shift = RigidTransform(RotationMatrix.MakeZRotation(0.01), [0.002, -0.001, 0.003])
    try:
        mount.SetPoseInParentFrame(cell.context, shift.multiply(nominal))
        # The parent of the mount, the pedestal, stands at the world's origin.
        expected = shift.multiply(before)
        assert cell.pose("flange", HOME).IsNearlyEqualTo(expected, 1e-12)
    finally:
        mount.SetPoseInParentFrame(cell.context, nominal)


# --- the example programs -------------------------------------------------------------


def test_weld_path_has_unique_labels_and_positive_speeds(robot):
    labels, joints, speeds = read_weld_path(robot)
    assert 110 <= len(joints) <= 140
    assert len(set(labels)) == len(labels)
    assert np.all((speeds > 0) & (speeds <= 250))


def test_weld_path_keeps_limits_and_one_branch(cell):
    _, joints, _ = read_weld_path(cell.robot)
    assert np.all(joints < cell.plant.GetPositionUpperLimits())
    assert np.all(joints > cell.plant.GetPositionLowerLimits())
    assert np.abs(np.diff(joints, axis=0)).max() < 0.1
    assert np.all(np.sin(joints[:, 2]) > 0.5)  # elbow: neither stretched nor switched
    assert np.all(np.sin(joints[:, 4]) < -0.5)  # wrist: likewise


def test_weld_path_stays_away_from_singularities(cell):
    _, joints, _ = read_weld_path(cell.robot)
    smallest = [np.linalg.svd(cell.flange_jacobian(q), compute_uv=False)[-1] for q in joints]
    assert min(smallest) > 0.1


def test_weld_path_collides_with_nothing(cell):
    _, joints, _ = read_weld_path(cell.robot)
    for q in between(joints, steps=3):
        assert cell.collisions(q) == set(), q


def test_weld_path_follows_the_plate_3_mm_above_it(cell):
    labels, joints, _ = read_weld_path(cell.robot)
    weld = [q for label, q in zip(labels, joints, strict=True) if label.startswith(("rectangle", "raster"))]
    assert len(weld) > 90
    for q in weld:
        x, y, z = cell.pose("tool_tip", q, relative_to="workpiece").translation()
        assert z == pytest.approx(0.003, abs=1e-6)
        assert abs(x) < 0.125
        assert abs(y) < 0.2


def test_pose_path_is_smooth_reachable_and_free(ur5_cell):
    columns = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    labels, values = read_columns(MODELS / "ur5" / "pose_path.csv", columns)
    positions, quaternions = values[:, :3] / 1000, values[:, 3:]
    assert len(labels) == len(set(labels)) == 60
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1, atol=1e-9)
    # Neighbours share the sign of the quaternion, so it may be interpolated as it is.
    assert np.all(np.sum(quaternions[1:] * quaternions[:-1], axis=1) > 0.99)

    q = HOME
    for k, (position, wxyz) in enumerate(zip(positions, quaternions, strict=True)):
        solution = follow(ur5_cell, RigidTransform(Quaternion(wxyz), position), q)
        if k > 0:
            assert np.abs(solution - q).max() < 0.1
        assert ur5_cell.collisions(solution) == set()
        q = solution


def follow(cell: Cell, target: RigidTransform, q: np.ndarray) -> np.ndarray:
    """Joint values for a flange pose in base_link, by Newton from a neighbour."""
    for _ in range(50):
        pose = cell.pose("flange", q, relative_to="base_link")
        turn = (target.rotation() @ pose.rotation().inverse()).ToAngleAxis()
        shift = target.translation() - pose.translation()
        error = np.r_[turn.angle() * turn.axis(), shift]
        if np.abs(error).max() < 1e-9:
            return q
        q = q + np.linalg.solve(cell.flange_jacobian(q), error)
    raise AssertionError(f"not reached: {target}")
