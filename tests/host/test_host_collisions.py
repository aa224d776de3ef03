"""Collisions are looked for in the host's own plant, where the host has it. Distances are worked out by hand."""

import numpy as np
import pytest
from foreign_host import X_GT, RealCell, arm_instance, build_plant, path, plugin_for
from pydrake.geometry import Box, HalfSpace, Role, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.systems.framework import DiagramBuilder
from pydrake.trajectories import PiecewisePolynomial
from truepath.rewriting.options import RewriteOptions

RADIUS_M, EDGE_M, DEEP_M = 0.005, 0.010, 0.0003
LEFT = np.array([0.4, -1.2, 1.1, -0.5, 0.8, 0.2])  # where the left arm holds its block into the way
TOUCHING = 5  # waypoint


class Host:
    """The foreign host with shapes: a ball at the tip of the right tool, a block in the left one's, and a floor.

    With the left arm at ``LEFT`` the block stands where the program takes the ball 0.3 mm into it. Today the real
    tool misses its way, and the block; unless it is meant to go deeper.
    """

    def __init__(self, drawn, real, deep_m=DEEP_M):
        q = path(10)[TOUCHING]
        self.meant, self.today = drawn.poses(q)[0, :3, 3], real.poses(q)[0, :3, 3]
        away = (self.today - self.meant) / np.linalg.norm(self.today - self.meant)
        middle = self.meant - away * (RADIUS_M - deep_m + EDGE_M / 2)
        X_WK = RigidTransform(RotationMatrix.MakeFromOneVector(away, 2), middle)
        bare = build_plant()
        X_KL = X_WK.inverse() @ self._left(bare, bare.CreateDefaultContext())
        self.before_mm = 1e3 * (np.linalg.norm(self.today - self.meant) - deep_m)
        builder = DiagramBuilder()
        self.plant, self.scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        build_plant(self.plant, lambda plant: self._furnish(plant, X_KL.inverse()))
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)
        self._left(self.plant, self.context)

    @staticmethod
    def _left(plant, context):
        plant.SetPositions(context, arm_instance(plant, "left"), LEFT)
        body = plant.GetBodyByName("gripper", plant.GetModelInstanceByName("left_tool"))
        return body.EvalPoseInWorld(context)

    @staticmethod
    def _furnish(plant, X_LK):
        rough = CoulombFriction(0.5, 0.5)
        right, left = (
            plant.GetBodyByName("gripper", plant.GetModelInstanceByName(f"{side}_tool")) for side in ("right", "left")
        )
        plant.RegisterCollisionGeometry(right, X_GT, Sphere(RADIUS_M), "ball", rough)
        plant.RegisterCollisionGeometry(left, X_LK, Box(EDGE_M, EDGE_M, EDGE_M), "block", rough)
        plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform([0, 0, -3.0]), HalfSpace(), "floor", rough)


@pytest.fixture(scope="module")
def host(drawn, rigid_cell):
    return Host(drawn, rigid_cell)


@pytest.fixture
def plugin(host, rigid):
    plugin = plugin_for(host.plant, scene_graph=host.scene_graph)
    plugin.use(rigid.calibration)
    return plugin


@pytest.fixture
def program(tmp_path):
    rows = [",".join(f"{value:.12f}" for value in row) for row in path(10)]
    file = tmp_path / "path.csv"
    file.write_text("\n".join([",".join(f"q{i}_rad" for i in range(1, 7)), *rows]) + "\n")
    return file


def about_the_block(findings):
    return [each for each in findings if "left_tool::gripper" in each.message and "right_tool::gripper" in each.message]


def test_the_other_arm_is_where_the_hosts_context_has_it(host, plugin, program):
    rewritten = plugin.correct(program, context=host.context)
    assert rewritten.cell == rewritten.summary()["cell"] == "the host's plant"
    (finding,) = [each for each in about_the_block(rewritten.findings) if each.line == TOUCHING + 2]
    assert (finding.level, finding.guard) == ("warning", "collision")
    assert finding.value == pytest.approx(-1e3 * DEEP_M, abs=0.06)
    assert f"{host.before_mm:.1f}" in finding.message.split("after the correction, ")[1]
    assert "so does the program in the cell as drawn" in finding.message
    assert host.before_mm > 0.2


def test_by_default_it_is_where_the_plant_has_it_and_the_way_is_free(plugin, program):
    rewritten = plugin.correct(program)
    assert rewritten.cell == "the host's plant"
    assert rewritten.findings == ()


def test_the_context_of_the_diagram_will_do_and_trajectories_are_looked_at_too(host, plugin):
    q = path(10)[TOUCHING:]
    trajectory = PiecewisePolynomial.CubicShapePreserving(np.linspace(0.0, 4.0, len(q)), q.T, True)
    corrected = plugin.correct(trajectory, context=host.root)
    assert corrected.rewritten.cell == "the host's plant"
    deepest = min(each.value for each in about_the_block(corrected.findings))
    assert deepest == pytest.approx(-1e3 * DEEP_M, abs=0.1)
    assert plugin.correct(trajectory).findings == ()


def test_nothing_of_the_host_is_touched(host, plugin, program):
    inspector = host.scene_graph.model_inspector()

    def everything():
        shapes = [type(inspector.GetShape(each)) for each in inspector.GetAllGeometryIds(Role.kProximity)]
        assert HalfSpace in shapes
        bodies = [
            host.plant.GetBodyByName("gripper", host.plant.GetModelInstanceByName(f"{side}_tool"))
            for side in ("left", "right")
        ]
        poses = [body.EvalPoseInWorld(host.context).GetAsMatrix4() for body in bodies]
        parameters = host.context.get_parameters()
        numbers = [
            parameters.get_numeric_parameter(k).CopyToVector() for k in range(parameters.num_numeric_parameter_groups())
        ]
        return np.concatenate([host.plant.GetPositions(host.context), *numbers, np.ravel(poses)]).tobytes()

    before = everything()
    plugin.correct(program, context=host.context)
    assert everything() == before


def test_frames_that_the_host_has_set_for_the_other_arm_count(host, plugin, program):
    """Its block is lifted out of the way by the frame by which the left flange hangs on its link."""
    context = host.plant.CreateDefaultContext()
    host._left(host.plant, context)
    mount = host.plant.GetJointByName("flange_joint", arm_instance(host.plant, "left")).frame_on_parent()
    mount.SetPoseInParentFrame(context, mount.GetPoseInParentFrame(context) @ RigidTransform([0.1, 0.1, 0.1]))
    assert about_the_block(plugin.correct(program, context=host.context).findings)
    assert not about_the_block(plugin.correct(program, context=context).findings)


def test_where_nobody_can_look_it_is_said(host, plugin, rigid, program):
    (bare,) = rigid.correct(program).findings
    assert "not registered with a SceneGraph" in bare.message
    plugin.scene_graph = None
    (told,) = plugin.correct(program).findings
    assert "scene_graph=" in told.message
    assert {(each.level, each.guard) for each in (bare, told)} == {("warning", "collision")}
    trajectory = PiecewisePolynomial.CubicShapePreserving(np.linspace(0.0, 4.0, 10), path(10).T, True)
    assert any("nothing was looked for" in warning for warning in plugin.correct(trajectory).warnings)
    assert plugin.correct(program, collisions=False).findings == ()
    elsewhere = plugin.correct(program, options=RewriteOptions(cell="ur5"))
    assert elsewhere.cell == "ur5"


def test_an_arm_without_shapes_meets_nothing(rigid, program):
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    build_plant(plant)
    for geometry in scene_graph.model_inspector().GetAllGeometryIds(Role.kProximity):
        scene_graph.RemoveRole(plant.get_source_id(), geometry, Role.kProximity)
    plugin = plugin_for(plant, scene_graph=scene_graph)
    plugin.use(rigid.calibration)
    (told,) = plugin.correct(program).findings
    assert "proximity role" in told.message


def test_the_real_cell_confirms_it(host, plugin, program, rigid_cell):
    """The corrected real tool is as deep in the block as the finding says."""
    q = plugin.correct(program, context=host.context).correction.q_rad[TOUCHING]
    away = (host.today - host.meant) / np.linalg.norm(host.today - host.meant)
    depth = (rigid_cell.poses(q)[0, :3, 3] - host.meant) @ away - DEEP_M
    assert depth == pytest.approx(-DEEP_M, abs=5e-5)
    assert isinstance(rigid_cell, RealCell)


def test_a_program_that_collides_by_itself_is_told_how_deep(drawn, rigid_cell, rigid, program):
    """The ball is meant to be 8 mm in the block, and is in it today: the correction brings nothing new."""
    host = Host(drawn, rigid_cell, deep_m=0.008)
    assert host.before_mm < -1.0
    plugin = plugin_for(host.plant, scene_graph=host.scene_graph)
    plugin.use(rigid.calibration)
    rewritten = plugin.correct(program, context=host.context)
    (finding,) = [each for each in about_the_block(rewritten.findings) if each.line == TOUCHING + 2]
    assert (finding.level, finding.guard) == ("warning", "collision")
    assert finding.value == pytest.approx(-8.0, abs=0.06)
    assert finding.message.startswith("the program itself drives left_tool::gripper and right_tool::gripper ")
    assert any("in line 7: the program itself" in warning for warning in rewritten.warnings)
    told = f"<RewrittenProgram {program}: 10 of 10 targets corrected, {len(rewritten.warnings)} warnings, looked for"
    assert repr(rewritten) == f"{told} collisions in the host's plant>"


# Whatever is shown is judged like what is corrected


@pytest.fixture
def showing(host, rigid, meshcat):
    plugin = plugin_for(host.plant, scene_graph=host.scene_graph, meshcat=meshcat)
    plugin.use(rigid.calibration)
    yield plugin
    plugin.remove()


def test_what_is_shown_is_judged_in_the_context_that_was_stated(host, showing, program):
    shown = showing.preview(program, context=host.root)
    assert any("left_tool::gripper" in warning for warning in shown.warnings)
    assert shown.looked_in == "the host's plant"
    assert showing.preview(program, context=host.context, collisions=False).warnings == ()
    assert showing.preview(program).warnings == ()


def test_of_a_trajectory_they_are_stepped_to_at_their_time(host, showing):
    q = path(10)[TOUCHING:]
    trajectory = PiecewisePolynomial.CubicShapePreserving(np.linspace(0.0, 4.0, len(q)), q.T, True)
    remarks = showing.operate(trajectory, context=host.context).view.course.remarks
    (first, *_) = [each for each in remarks if "left_tool::gripper" in each.text]
    assert "at 0.000 s" in first.text
    assert first.waypoint == 0


def test_on_a_page_they_are_told_too(host, showing, program, tmp_path):
    page = tmp_path / "page.html"
    showing.preview(program, context=host.context, output=page, robot_source="ur5")
    assert "left_tool::gripper" in page.read_text(encoding="utf-8")


def test_none_is_nowhere_as_on_the_command_line(host, showing, program):
    nowhere = RewriteOptions(cell="none")
    rewritten = showing.correct(program, options=nowhere, context=host.context)
    assert (rewritten.cell, rewritten.findings) == (None, ())
    assert showing.preview(program, options=nowhere).looked_in is None
