"""A host's own plant as the cell in which collisions are looked for; nothing of the host is changed or moved."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truepath.cell_geometry import GeometryPairs, floors_as_boxes
from truepath.errors import InputError
from truepath.guards import Finding
from truepath.host.arm_in_plant import ArmInPlant
from truepath.host.context_frames import WITH_FLANGE, ToolWay, apply_frames, context_as_drawn
from truepath.host.placed_robot import PlacedRobot
from truepath.model import CalibratedModel
from truepath.posed_cell import PosedCell
from truepath.region import Region

if TYPE_CHECKING:
    from pydrake.geometry import SceneGraph
    from pydrake.systems.framework import Context


@dataclass(frozen=True, eq=False)
class HostCell:
    """The plant around an arm.

    Attributes:
        robot: the calibrated one in its place: where it knows base and tool, these are not taken from the context.
        scene_graph: with which the plant is registered.
        context: of the plant: where all else stands, and what frames the host has moved; None: as drawn.
    """

    robot: PlacedRobot
    scene_graph: SceneGraph
    context: Context | None = None

    def __str__(self) -> str:
        return "the host's plant"

    @property
    def file(self) -> Path | None:
        """See ``Surroundings``."""
        return None

    def with_robot(self, model: CalibratedModel) -> PosedCell:
        """See ``Surroundings``. Where the tool can only be moved together with the flange, both are."""
        from pydrake.common.value import Value

        place, scene_graph = self.robot.place, self.scene_graph
        assert place is not None, "a robot in a host's plant"
        plant, context = place.plant, context_as_drawn(self.robot, self.context)
        self._set_frames(replace(self.robot, model=model), context)
        shapes = scene_graph.CreateDefaultContext()
        floors_as_boxes(plant, scene_graph, shapes)
        poses_in = scene_graph.get_source_pose_port(plant.get_source_id())
        poses_out, answers = plant.get_geometry_pose_output_port(), scene_graph.get_query_output_port()

        def query() -> Any:
            poses_in.FixValue(shapes, Value(poses_out.Eval(context)))
            return answers.Eval(shapes)

        first = query()
        return PosedCell(plant, context, place.arm, first.inspector(), query, (scene_graph, shapes, first))

    def _set_frames(self, robot: PlacedRobot, context: Context) -> None:
        ways: tuple[ToolWay, ...] = (True, WITH_FLANGE, False)
        for way in ways:
            try:
                applied = apply_frames(robot, context, base=True, tool=way)
            except InputError:
                if way is False:
                    raise
                continue
            if applied.tool != "frame alone":  # the shapes of the tool are what counts
                return


def host_cell(
    place: ArmInPlant, model: CalibratedModel, region: Region, scene_graph: SceneGraph | None, context: Context | None
) -> HostCell | Finding:
    """The plant as a cell, or why collisions cannot be looked for in it."""
    if not place.plant.geometry_source_is_registered():
        return _nowhere("the host's plant is not registered with a SceneGraph, so it has no shapes")
    if scene_graph is None:
        return _nowhere(
            "the plugin was not given the SceneGraph of the host's plant: CalibrationPlugin(scene_graph=...)"
        )
    cell = HostCell(PlacedRobot(model, region, place.robot.X_WB, place.X_FT, place), scene_graph, context)
    try:
        posed = cell.with_robot(model)
    except InputError as error:
        return _nowhere(error.problem)
    if not GeometryPairs.of(posed.plant, posed.inspector, posed.context, posed.arm).ids:
        return _nowhere("no shape of the arm in the host's plant has a proximity role and anything to meet")
    return cell


def _nowhere(why: str) -> Finding:
    return Finding("warning", "collision", None, f"nothing was looked for: {why}")
