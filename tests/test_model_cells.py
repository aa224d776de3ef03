"""The cells hold robot, pedestal, table and tool, each where it belongs, and what collides there is seen."""

import numpy as np
import pytest
from drawn_cell import HALF_PI, HOME, MODELS, ROBOTS, Cell
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant


@pytest.fixture(scope="module", params=ROBOTS)
def cell(request) -> Cell:
    return Cell(request.param)


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
