"""How tools and flanges are mounted in hosts' plants, and what of it a context lets be moved. The truth is Drake's."""

import re
from functools import cache

import numpy as np
import pytest
from foreign_host import small, some_joints
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, SpatialInertia
from pydrake.systems.framework import DiagramBuilder
from truepath import plants
from truepath.errors import InputError
from truepath.host import CalibrationPlugin
from truepath.host.host_cell import HostCell
from truepath.host.placed_robot import PlacedRobot

X_FG, X_GT = RigidTransform(RollPitchYaw(0.1, -0.2, 0.7), [0.01, -0.02, 0.03]), RigidTransform([0.05, 0.02, 0.14])
FLANGE = re.compile(r'\s*<link name="flange"/>\s*<joint name="flange_joint".*?</joint>', re.DOTALL)
EXACT_M = 2e-6  # to which frames are found from exact positions


def build(mounted, flange=True, plant=None):
    """A UR5 with a pen, which is mounted in one of the ways that people mount tools in; with a flange or without."""
    plant = MultibodyPlant(0.0) if plant is None else plant
    text = plants.resolve("ur5").read_text()
    (arm,) = plants.make_parser(plant).AddModelsFromString(text if flange else FLANGE.sub("", text), "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link", arm))
    end = plant.GetFrameByName("flange" if flange else "wrist_3_link", arm)
    if mounted == "no body":
        plant.AddFrame(FixedOffsetFrame("tcp", end, X_FG @ X_GT))
        plant.Finalize()
        return plant
    pen = plant.AddRigidBody("pen", plant.AddModelInstance("pen"), SpatialInertia.SolidCubeWithDensity(500.0, 0.05))
    if mounted == "on a frame":
        plant.WeldFrames(plant.AddFrame(FixedOffsetFrame("holder", end, X_FG)), pen.body_frame())
    elif mounted == "by a frame of its own":
        own = plant.AddFrame(FixedOffsetFrame("shank", pen.body_frame(), X_FG.inverse()))
        plant.WeldFrames(end, own)
    else:
        plant.WeldFrames(end, pen.body_frame(), X_FG)
    if mounted != "welded, no frame":
        plant.AddFrame(FixedOffsetFrame("tcp", pen.body_frame(), X_GT))
    plant.Finalize()
    return plant


class Real:
    """The same, with joints and a holder of the pen that are not where they should be."""

    def __init__(self, flange, on_the_pen=X_GT):
        self.plant, rng = build("on a frame", flange), np.random.default_rng(5)
        self.context, self.on_the_pen = self.plant.CreateDefaultContext(), on_the_pen
        joints = [self.plant.get_joint(index) for index in self.plant.GetJointIndices()]
        frames = [joint.frame_on_parent() for joint in joints if joint.num_positions() == 1]
        for frame in (*frames, self.plant.GetFrameByName("holder")):
            X = small(rng, 4e-4, 6e-4 if frame.name() != "holder" else 0.0)
            frame.SetPoseInParentFrame(self.context, frame.GetPoseInParentFrame(self.context) @ X)

    def tool(self, q_rad):
        """``(N, 3)``."""
        found = []
        for q in q_rad:
            self.plant.SetPositions(self.context, q)
            X_WP = self.plant.GetFrameByName("pen").CalcPoseInWorld(self.context)
            found.append((X_WP @ self.on_the_pen).translation())
        return np.array(found)


@cache
def measured(flange, frame):
    on_the_pen = X_GT if frame == "tcp" else RigidTransform()
    real, q = Real(flange, on_the_pen), some_joints(70, 7)
    return real, q, real.tool(q)


def applied(mounted, flange=True, frame="tcp", **how):
    """Plant, context, what was reported, and by how much the tool in the context is off from the real one, m."""
    plant, (real, q, points) = build(mounted, flange), measured(flange, frame)
    plugin = CalibrationPlugin(plant, model_instance="ur5", tool_frame=frame)
    plugin.calibrate(plugin.measurements(q, points), effects="none")
    context = plant.CreateDefaultContext()
    told = plugin.apply(context, **how)
    off = []
    for joints, point in zip(some_joints(8, 3), real.tool(some_joints(8, 3)), strict=True):
        plant.SetPositions(context, joints)
        off.append(np.linalg.norm(plant.GetFrameByName(frame).CalcPoseInWorld(context).translation() - point))
    return plant, context, told, max(off)


def moved_on(plant, context, name, end):
    """By how much a frame stands otherwise on the end of the arm than it is drawn, m."""
    frame, last = plant.GetFrameByName(name), plant.GetFrameByName(end)
    drawn = plant.CreateDefaultContext()
    X, X_drawn = (frame.CalcPose(each, last).GetAsMatrix4() for each in (context, drawn))
    return np.abs(X - X_drawn).max()


@pytest.mark.parametrize("mounted", ["on a frame", "by a frame of its own"])
def test_a_tool_is_moved_as_a_whole_by_either_frame_of_its_weld(mounted):
    plant, context, told, off = applied(mounted)
    assert (told.tool, told.flange) == ("frame", "frame")
    assert off < EXACT_M
    assert moved_on(plant, context, "pen", "flange") > 1e-4
    assert any(name in " ".join(told.frames) for name in ("holder", "shank"))


def test_where_only_the_tool_frame_can_be_moved_it_is_told_that_the_body_stays():
    plant, context, told, off = applied("welded")
    assert told.tool == "frame alone"
    assert off < EXACT_M
    assert moved_on(plant, context, "pen", "flange") < 1e-12


def test_a_frame_without_a_body_is_all_there_is_of_a_tool():
    _, _, told, off = applied("no body")
    assert told.tool == "frame"
    assert off < EXACT_M


def test_a_tool_that_cannot_be_moved_is_refused_with_what_to_do_and_how_far_it_is_off():
    with pytest.raises(InputError, match=r"1\.\d+ mm away") as caught:
        applied("welded, no frame", frame="pen")
    for advice in ("FixedOffsetFrame(name, flange", "tool=False, which sets all the rest", "tool='with flange'"):
        assert advice in caught.value.expected


def test_without_the_tool_all_the_rest_is_set():
    plant, context, told, off = applied("welded, no frame", frame="pen", tool=False)
    assert (told.tool, told.flange) == ("as drawn", "frame")
    assert moved_on(plant, context, "pen", "flange") < 1e-12
    assert EXACT_M < off < 2e-3  # what the pen is off on the flange


def test_flange_and_tool_can_be_moved_as_one():
    plant, context, told, off = applied("welded, no frame", frame="pen", tool="with flange")
    assert (told.tool, told.flange) == ("with flange", "with tool")
    assert off < EXACT_M
    assert moved_on(plant, context, "pen", "flange") < 1e-12
    with pytest.raises(InputError, match="unknown way"):
        applied("welded", tool="somehow")


@pytest.mark.parametrize("mounted", ["on a frame", "by a frame of its own", "welded"])
def test_where_collisions_are_looked_for_the_body_of_the_tool_is_where_it_really_is(mounted):
    """Also where a tool can only be moved together with the flange."""
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    build(mounted, plant=plant)
    real, q, points = measured(True, "tcp")
    plugin = CalibrationPlugin(plant, model_instance="ur5", tool_frame="tcp", scene_graph=scene_graph)
    calibration = plugin.calibrate(plugin.measurements(q, points), effects="none")
    posed = HostCell(PlacedRobot.of(plugin), scene_graph).with_robot(calibration.model)
    for joints, point in zip(some_joints(4, 3), real.tool(some_joints(4, 3)), strict=True):
        plant.SetPositions(posed.context, joints)
        X_WP = plant.GetFrameByName("pen").CalcPoseInWorld(posed.context)
        assert np.linalg.norm((X_WP @ X_GT).translation() - point) < EXACT_M


@pytest.mark.parametrize("mounted", ["on a frame", "no body", "welded"])
def test_an_arm_without_a_flange_of_its_own_gets_its_axes_and_its_tool(mounted):
    """Its last link stays on its axis, for nothing between the two can be moved; the tool is right all the same."""
    _, _, told, off = applied(mounted, flange=False)
    assert told.flange == "as drawn"
    assert told.tool == ("frame alone" if mounted == "welded" else "frame")
    assert off < EXACT_M


def test_without_flange_and_tool_frame_the_axes_are_set():
    plant, (_, q, points) = build("no body", flange=False), measured(False, "tcp")
    plugin = CalibrationPlugin(plant, model_instance="ur5")
    plugin.calibrate(plugin.measurements(q, points), effects=())
    context = plant.CreateDefaultContext()
    told = plugin.apply(context)
    assert (told.flange, told.tool) == ("as drawn", "as drawn")
    assert sum("wrist" in name or "shoulder" in name or "elbow" in name for name in told.frames) == 6
    # The link turns about the axis that the calibration has found.
    last, model = plant.GetJointByName("wrist_3_joint"), plugin.calibration.model
    R_WB = (model.X_MB @ np.linalg.inv(model.X_MB_nominal))[:3, :3]
    for q in some_joints(3, 4):
        plant.SetPositions(context, q)
        turned = [model.flange_poses((q + a * np.eye(6)[5])[None])[0][:3, :3] for a in (0.0, 1.0)]
        motion = turned[1] @ turned[0].T
        axis = np.array([motion[2, 1] - motion[1, 2], motion[0, 2] - motion[2, 0], motion[1, 0] - motion[0, 1]])
        z = last.frame_on_parent().CalcPoseInWorld(context).rotation().matrix() @ last.revolute_axis()
        assert np.abs(z - R_WB @ axis / np.linalg.norm(axis)).max() < 1e-9
    assert np.abs(model.p[20:24]).max() > 1e-5


@pytest.mark.parametrize("flange", [True, False])
@pytest.mark.parametrize("mounted", ["on a frame", "by a frame of its own", "welded"])
def test_reset_undoes_it_to_the_bit(mounted, flange):
    plant, context, told, _ = applied(mounted, flange)
    assert told.frames
    plugin = CalibrationPlugin(plant, model_instance="ur5", tool_frame="tcp")
    plugin.reset(context)
    drawn = plant.CreateDefaultContext()
    plant.SetPositions(drawn, plant.GetPositions(context))
    for name in ("pen", "wrist_3_link", "tcp"):
        frame = plant.GetFrameByName(name)
        assert frame.CalcPoseInWorld(context).IsExactlyEqualTo(frame.CalcPoseInWorld(drawn))
