"""Frames that a host has set on its own context, and contexts that are none of the plant's: what is left alone."""

import numpy as np
import pytest
from foreign_host import arm_instance, build_plant, plugin_for, some_joints
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from truepath.errors import InputError
from truepath.host.host_cell import HostCell
from truepath.host.placed_robot import PlacedRobot

LIFT = RigidTransform([0.0, 0.0, 0.05])


def lifted(plant):
    """A context in which the host itself has moved the mounts of the right arm and of its gripper."""
    context = plant.CreateDefaultContext()
    for name in ("wall", "gripper_mount"):
        frame = plant.GetFrameByName(name)
        frame.SetPoseInParentFrame(context, LIFT @ frame.GetPoseInParentFrame(context))
    return context


def mounts_of(plant, context):
    return [plant.GetFrameByName(name).GetPoseInParentFrame(context) for name in ("wall", "gripper_mount")]


def test_what_the_host_has_set_stays_where_it_is_not_wanted_to_be_set(plant, rigid):
    context = lifted(plant)
    rigid.apply(context, base=False, tool=False)
    for X, expected in zip(mounts_of(plant, context), mounts_of(plant, lifted(plant)), strict=True):
        assert X.IsExactlyEqualTo(expected)


@pytest.fixture(scope="module")
def from_anywhere(plant, rigid_cell):
    """Calibrated with a tracker that stood anywhere and a reflector somewhere: nothing is known of base and tool."""
    plugin, q = plugin_for(plant), some_joints(80, 7)
    measurements = plugin.measurements(q, rigid_cell.measure(q, 8), measured_in="tracker", probe="unknown")
    plugin.calibrate(measurements, effects="none")
    return plugin


def test_what_the_host_has_set_stays_where_nothing_is_known(plant, from_anywhere):
    context, expected = lifted(plant), mounts_of(plant, lifted(plant))
    told = from_anywhere.apply(context)
    assert (told.base, told.tool, told.flange) == ("as drawn", "as drawn", "frame")
    assert all(X.IsExactlyEqualTo(X_set) for X, X_set in zip(mounts_of(plant, context), expected, strict=True))
    from_anywhere.reset(context)
    drawn = mounts_of(plant, plant.CreateDefaultContext())
    assert all(X.IsExactlyEqualTo(X_drawn) for X, X_drawn in zip(mounts_of(plant, context), drawn, strict=True))


def test_collisions_are_looked_for_with_the_arm_on_the_hosts_own_mount(from_anywhere, rigid):
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    build_plant(plant)
    _diagram = builder.Build()
    plugin, base = plugin_for(plant), plant.GetBodyByName("base_link", arm_instance(plant, "right"))
    context = lifted(plant)
    for calibration, height_m in ((from_anywhere.calibration, 0.05), (rigid.calibration, 0.0)):
        plugin.use(calibration)
        robot = PlacedRobot.of(plugin)
        stands = HostCell(robot, scene_graph, context).with_robot(robot.model).context
        X_WB = base.EvalPoseInWorld(stands).translation()
        assert np.linalg.norm(X_WB - plugin.robot.X_WB[:3, 3] - [0, 0, height_m]) < 5e-3
        assert np.linalg.norm(PlacedRobot.of(plugin, context).X_WB[:3, 3] - plugin.robot.X_WB[:3, 3]) == pytest.approx(
            height_m, abs=1e-12
        )


@pytest.mark.parametrize("context", [None, 3, "context"])
def test_what_is_no_context_is_refused(rigid, context):
    for what in (rigid.apply, rigid.reset):
        with pytest.raises(InputError, match="does not belong to the plant"):
            what(context)


def test_a_plant_without_a_diagram_takes_no_context_of_another(rigid):
    builder = DiagramBuilder()
    other, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    build_plant(other)
    foreign = builder.Build().CreateDefaultContext()
    with pytest.raises(InputError, match="does not belong to the plant"):
        rigid.apply(foreign)
