"""Whether the arm keeps a margin, asked of Drake in one quick question: shapes grown by the margin must not touch.

Drake tells ten times as fast whether shapes touch as how far they are apart. Each of two shapes grows by half of the
margin, so that they touch where they would come nearer. Edges and corners stay sharp instead of being rounded: there a
little more than the margin is kept, never less. Bodies that are near each other by design must only not touch: they
have shapes of their true size beside the grown ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from truepath.cell_geometry import place_robot
from truepath.clearance import Cell
from truepath.errors import InputError
from truepath.lie import Array
from truepath.model import CalibratedModel

if TYPE_CHECKING:
    from pydrake.geometry import (
        CollisionFilterManager,
        GeometryId,
        SceneGraph,
        SceneGraphInspector,
        Shape,
        SourceId,
    )
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.systems.framework import Context

NEIGHBOURS = 0.5  # share of free postures in which bodies must be nearer than the margin to count as neighbours
SAMPLED_POSTURES = 60


class RoomyCell(Cell):
    """A cell that can ask for more room than not to touch.

    Args:
        spec: built-in name, URDF or directives; of a built-in robot the cell that comes with it.
        model: the robot; without effects, so that its joints take the angles that are commanded.
        margin_m: bodies that are nearer than this in most postures are neighbours, of which no margin is asked.

    Raises:
        InputError: as ``clearance.Cell``.
    """

    def __init__(self, spec: str | Path, model: CalibratedModel, margin_m: float) -> None:
        super().__init__(spec, model)
        lower, upper = np.maximum(model.robot.lower_rad, -np.pi), np.minimum(model.robot.upper_rad, np.pi)
        drawn = np.random.default_rng(0).uniform(lower, upper, (8 * SAMPLED_POSTURES, len(lower)))
        free = drawn[~self.collides(drawn)][:SAMPLED_POSTURES]
        near = self.clearances(free, margin_m)
        often = (near.by_pair_m <= margin_m).sum(axis=0) >= NEIGHBOURS * max(len(free), 1)
        self.neighbours = {pair for pair, so in zip(near.bodies, often, strict=True) if so}

    def room(self, margin_m: float) -> Room:
        """The question whether the arm keeps a margin to all but its neighbours, and touches none of those."""
        from pydrake.geometry import Role

        posed, inspector = self._posed, self._posed.inspector
        diagram, _ = posed.owner
        scene_graph, source = diagram.GetSubsystemByName("scene_graph"), posed.plant.get_source_id()
        root = diagram.CreateDefaultContext()
        context, shapes = posed.plant.GetMyMutableContextFromRoot(root), scene_graph.GetMyMutableContextFromRoot(root)
        place_robot(self.model, posed.plant, context, posed.arm)
        bodies = [self._pairs.bodies[number] for number in self._pairs.body_pair]
        near = [pair for pair, names in zip(self._pairs.ids, bodies, strict=True) if names in self.neighbours]
        apart = [pair for pair, names in zip(self._pairs.ids, bodies, strict=True) if names not in self.neighbours]
        as_drawn = {g: _add_copy(scene_graph, shapes, inspector, source, g) for g in dict.fromkeys(chain(*near))}
        if margin_m > 0.0:
            for g in dict.fromkeys(chain(*apart)):
                scene_graph.ChangeShape(shapes, source, g, grown(inspector, g, margin_m / 2.0))
        everything = [*inspector.GetAllGeometryIds(Role.kProximity), *as_drawn.values()]
        watched = [*apart, *((as_drawn[a], as_drawn[b]) for a, b in near)]
        _watch_only(scene_graph.collision_filter_manager(shapes), everything, watched)
        port = posed.plant.get_geometry_query_input_port()
        return Room(posed.plant, context, self._positions.copy(), self._of_arm, lambda: port.Eval(context), root)


@dataclass(frozen=True, eq=False)
class Room:
    """A cell in a context of its own, in which shapes touch where the arm does not keep its margin.

    Attributes:
        plant, context: of the cell.
        positions: of the plant, of which those of the arm change.
        of_arm: places of the arm's joints among them.
        query: answers for the positions that the context has when it is called.
        owner: what must live as long as this.
    """

    plant: MultibodyPlant
    context: Context
    positions: Array
    of_arm: list[int]
    query: Callable[[], Any]
    owner: Any

    def is_kept(self, q_rad: Array) -> bool:
        """Whether the arm at joints ``(n,)`` keeps the margin; no, where Drake cannot tell."""
        self.positions[self.of_arm] = q_rad
        self.plant.SetPositions(self.context, self.positions)
        try:
            return not self.query().HasCollisions()
        except RuntimeError:
            return False


def grown(inspector: SceneGraphInspector, geometry: GeometryId, by_m: float) -> Shape:
    """A shape that holds all points no further than this from a shape of Drake's."""
    from pydrake.geometry import Box, Capsule, Convex, Cylinder, Ellipsoid, Sphere

    shape = inspector.GetShape(geometry)
    if isinstance(shape, Sphere):
        return Sphere(shape.radius() + by_m)
    if isinstance(shape, Box):
        return Box(*(shape.size() + 2.0 * by_m))
    if isinstance(shape, Cylinder):
        return Cylinder(shape.radius() + by_m, shape.length() + 2.0 * by_m)
    if isinstance(shape, Capsule):
        return Capsule(shape.radius() + by_m, shape.length())
    hull = inspector.GetConvexHull(geometry)
    if hull is not None:  # of a mesh: every corner becomes a cube, which holds a ball
        corners = np.array([hull.vertex(k) for k in range(hull.num_vertices())])
        cube = by_m * np.array(list(product((-1.0, 1.0), repeat=3)))
        return Convex(points=(corners[:, None] + cube).reshape(-1, 3).T, label="grown")
    if isinstance(shape, Ellipsoid):
        larger = 1.0 + by_m / min(shape.a(), shape.b(), shape.c())
        return Ellipsoid(larger * shape.a(), larger * shape.b(), larger * shape.c())
    raise InputError("no margin can be kept from a shape of this kind", found=type(shape).__name__)


def _add_copy(
    scene_graph: SceneGraph, shapes: Context, inspector: SceneGraphInspector, source: SourceId, geometry: GeometryId
) -> GeometryId:
    """The same shape once more, on the same body."""
    from pydrake.geometry import GeometryInstance, ProximityProperties

    shape, name = inspector.GetShape(geometry), f"{inspector.GetName(geometry)} as drawn"
    copy = GeometryInstance(inspector.GetPoseInFrame(geometry), shape, name)
    copy.set_proximity_properties(ProximityProperties())
    return scene_graph.RegisterGeometry(shapes, source, inspector.GetFrameId(geometry), copy)


def _watch_only(
    filters: CollisionFilterManager,
    everything: Sequence[GeometryId],
    watched: Sequence[tuple[GeometryId, GeometryId]],
) -> None:
    from pydrake.geometry import CollisionFilterDeclaration, GeometrySet

    filters.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(everything)))
    pairs = CollisionFilterDeclaration()
    for a, b in watched:
        pairs.AllowBetween(GeometrySet(a), GeometrySet(b))
    filters.Apply(pairs)
