"""The shapes of a cell in Drake: where a calibrated robot stands among them, and which of them can meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from truepath import lie
from truepath.arm import Arm, inboard_joints
from truepath.lie import Array
from truepath.model import CalibratedModel

if TYPE_CHECKING:
    from pydrake.geometry import GeometryId, SceneGraph, SceneGraphInspector
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import Frame, RigidBody
    from pydrake.systems.framework import Context

FLOOR_WIDTH_M, FLOOR_DEPTH_M = 40.0, 4.0
UNBOUNDED_M = 1e9


def floors_as_boxes(plant: MultibodyPlant, scene_graph: SceneGraph, context: Context | None = None) -> None:
    """Makes a large box of every half space of a plant: Drake measures no distance from one to most other shapes.

    Args:
        context: of the scene graph, in which alone that is so; None: in the scene graph itself, to be called before the
            diagram of the finalized plant is built.
    """
    from pydrake.geometry import Box, HalfSpace, Role
    from pydrake.math import RigidTransform

    inspector, source = scene_graph.model_inspector(), plant.get_source_id()
    where = () if context is None else (context,)
    box = Box(FLOOR_WIDTH_M, FLOOR_WIDTH_M, FLOOR_DEPTH_M)
    for geometry in inspector.GetAllGeometryIds(Role.kProximity):
        own = inspector.BelongsToSource(geometry, source)
        if own and isinstance(inspector.GetShape(geometry), HalfSpace):
            X_FG = inspector.GetPoseInFrame(geometry) @ RigidTransform([0, 0, -FLOOR_DEPTH_M / 2])
            scene_graph.ChangeShape(*where, source, geometry, box, X_FG)


def place_robot(model: CalibratedModel, plant: MultibodyPlant, context: Context, arm: Arm) -> None:
    """Sets on a context where the calibrated robot's joints, base and tool are.

    The joint frames as in ``export``. Base and tool move only where their nominal place was stated, as in
    ``CalibratedModel.goal_flange_poses``: the base by inv(X_MB_nominal) X_MB in its own frame, and all that the flange
    carries by X_FE inv(X_FE_nominal), because a probe that is mounted beside its place is a tool that is. A base that
    is welded without a frame of its own is moved from its first joint on: its own link then stays.

    Raises:
        InputError: the arm is not the calibrated one, or a frame cannot be moved.
    """
    from pydrake.math import RigidTransform

    from truepath.export import set_calibrated_frames
    from truepath.robot import zero_context

    zero = zero_context(plant, arm)
    set_calibrated_frames(model, plant, context, model_instance=arm.instance, flange_frame=arm.flange.name())
    X_MB, X_FE = model.frames_now()
    moved = []
    if model.base_is_given:
        mount = _mount(plant, arm.base) or arm.joints[0].frame_on_parent()
        moved.append((mount, arm.base, lie.invert(model.X_MB_nominal) @ X_MB))
    if model.tool_is_given:
        mount = _mount(plant, arm.flange)
        if mount is not None:  # else the frames could not have been set
            moved.append((mount, arm.flange, X_FE @ lie.invert(model.X_FE_nominal)))
    for mount, frame, motion in moved:
        X_HK = frame.CalcPose(zero, mount).GetAsMatrix4()  # K what is moved, in its own frame; H what holds it
        X_PH = mount.GetPoseInParentFrame(context).GetAsMatrix4() @ X_HK @ motion @ lie.invert(X_HK)
        X_PH[:3, :3] = lie.nearest_rotation(X_PH[:3, :3])
        mount.SetPoseInParentFrame(context, RigidTransform(X_PH))


def _mount(plant: MultibodyPlant, frame: Frame) -> Any:
    """The frame that a context can move, through which a frame or its body is welded to what holds it; or None."""
    from pydrake.multibody.tree import FixedOffsetFrame, JointIndex

    if isinstance(frame, FixedOffsetFrame):
        return frame
    inboard = inboard_joints(plant)
    body = frame.body()
    while (j := inboard.get(int(body.index()))) is not None:
        joint = plant.get_joint(JointIndex(j))
        if joint.type_name() != "weld":
            return None
        if isinstance(joint.frame_on_parent(), FixedOffsetFrame):
            return joint.frame_on_parent()
        body = joint.parent_body()
    return None


@dataclass(frozen=True, eq=False)
class GeometryPairs:
    """G pairs of shapes that the arm can bring together, and by how much a joint can change their distance.

    Attributes:
        ids: G pairs of Drake's geometries.
        bodies: P pairs of names, ``model::body``, the bodies of these shapes.
        body_pair: ``(G,)`` index into ``bodies``.
        reach_m: ``(G, n)``; if joint j turns by a, the distance of pair g changes by no more than a * reach_m[g, j].
    """

    ids: tuple[tuple[GeometryId, GeometryId], ...]
    bodies: tuple[tuple[str, str], ...]
    body_pair: Array
    reach_m: Array

    @classmethod
    def of(cls, plant: MultibodyPlant, inspector: SceneGraphInspector, context: Context, arm: Arm) -> GeometryPairs:
        """All pairs that Drake does not filter (it leaves out neighbours in the chain) and that the arm moves.

        Shapes that are not of this plant are left out.

        A joint j between the shapes carries the outer one about its axis; no point of that is further from the axis
        than its own size plus the links on the way there. The same holds for the inner one, seen from the outer: the
        smaller of the two bounds is taken. Distances change by no more than points move, joint after joint.
        """
        n = len(arm.joints)
        for joint in arm.joints:
            joint.set_angle(context, 0.0)
        origin = np.array([joint.frame_on_parent().CalcPoseInWorld(context).translation() for joint in arm.joints])
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(origin, axis=0), axis=1))])
        carrier = _carrying_joint(plant, arm)
        ids, names, rows = [], [], []
        for pair in sorted(inspector.GetCollisionCandidates(), key=lambda pair: [g.get_value() for g in pair]):
            bodies = [plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)) for geometry in pair]
            if None in bodies:
                continue
            inner, outer = sorted(range(2), key=lambda k: carrier[int(bodies[k].index())])
            a, b = (carrier[int(bodies[k].index())] for k in (inner, outer))
            if a == b:
                continue
            # Joint a (from 0) is the first between them, joint b - 1 the last.
            outer_size = _size(inspector, plant, context, pair[outer], bodies[outer], origin[b - 1])
            inner_size = _size(inspector, plant, context, pair[inner], bodies[inner], origin[a])
            reach = np.zeros(n)
            reach[a:b] = np.minimum(outer_size + along[b - 1] - along[a:b], inner_size + along[a:b] - along[a])
            ids.append(tuple(pair))
            names.append(tuple(sorted(body.scoped_name().get_full() for body in bodies)))
            rows.append(reach)
        unique = sorted(set(names))
        place = {name: k for k, name in enumerate(unique)}
        index = np.array([place[name] for name in names], dtype=int)
        return cls(tuple(ids), tuple(unique), index, np.array(rows).reshape(-1, n))

    def subset(self, keep: Array) -> GeometryPairs:
        """The pairs picked by an index array; the names stay."""
        ids = tuple(self.ids[k] for k in keep)
        return GeometryPairs(ids, self.bodies, self.body_pair[keep], self.reach_m[keep])


def _carrying_joint(plant: MultibodyPlant, arm: Arm) -> dict[int, int]:
    """For each body by index how many of the arm's joints move it: 0 for what stands still."""
    from pydrake.multibody.tree import BodyIndex, JointIndex

    inboard = inboard_joints(plant)
    number = {int(joint.index()): k + 1 for k, joint in enumerate(arm.joints)}
    carrier = {}
    for b in range(plant.num_bodies()):
        body = plant.get_body(BodyIndex(b))
        while (j := inboard.get(int(body.index()))) is not None and j not in number:
            body = plant.get_joint(JointIndex(j)).parent_body()
        carrier[b] = 0 if j is None else number[j]
    return carrier


def _size(
    inspector: SceneGraphInspector,
    plant: MultibodyPlant,
    context: Context,
    geometry: GeometryId,
    body: RigidBody,
    point_W: Array,
) -> float:
    """No point of the geometry is further than this from a point ``(3,)``, m."""
    X_WG = body.EvalPoseInWorld(context) @ inspector.GetPoseInFrame(geometry)
    return float(np.linalg.norm(X_WG.translation() - point_W)) + _radius(inspector, geometry)


def _radius(inspector: SceneGraphInspector, geometry: GeometryId) -> float:
    """Of a ball about the geometry's origin that holds it, m."""
    from pydrake.geometry import Box, Capsule, Cylinder, Ellipsoid, Sphere

    shape = inspector.GetShape(geometry)
    if isinstance(shape, Sphere):
        return float(shape.radius())
    if isinstance(shape, Box):
        return float(np.linalg.norm(shape.size())) / 2
    if isinstance(shape, Cylinder):
        return float(np.hypot(shape.radius(), shape.length() / 2))
    if isinstance(shape, Capsule):
        return float(shape.radius() + shape.length() / 2)
    if isinstance(shape, Ellipsoid):
        return float(max(shape.a(), shape.b(), shape.c()))
    hull = inspector.GetConvexHull(geometry)
    if hull is None:
        return UNBOUNDED_M  # never screened, always measured
    return float(max(np.linalg.norm(hull.vertex(k)) for k in range(hull.num_vertices())))
