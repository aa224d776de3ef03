"""An arm of a host's plant, drawn once more in its Meshcat, at joints of its own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from truepath.arm import inboard_joints
from truepath.host.arm_in_plant import ArmInPlant
from truepath.lie import Array

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat, Rgba, SceneGraph, Shape
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.systems.framework import Context

PLAIN = (0.78, 0.79, 0.81, 1.0)  # of shapes that state no colour
BONE_RADIUS_SHARE, JOINT_BALL, TOOL_ROD = 0.025, 1.3, 0.35  # of the arm's length; in radii of a bone


class DrawnArm:
    """All that the joints of an arm move, from the illustration geometry of the host's scene graph.

    Has a context of its own: nobody else's is read or changed.

    Args:
        meshcat: to draw in.
        path: below which.
        place: the arm.
        scene_graph: with which its plant is registered; None: rods from joint to joint stand for the shapes.
        paint: colour for all of it, alpha included; None: its own.
        context: of the plant, for all but the joints of the arm, such as the fingers of a gripper; it is copied.
            None: as the plant has it by default.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        path: str,
        place: ArmInPlant,
        scene_graph: SceneGraph | None,
        paint: Rgba | None = None,
        context: Context | None = None,
    ) -> None:
        self._meshcat, self._place, plant = meshcat, place, place.plant
        self._context = plant.CreateDefaultContext()
        if context is not None:
            self._context.SetTimeStateAndParametersFrom(context)
        self._positions = plant.GetPositions(self._context)
        moved = [] if scene_graph is None else moved_bodies(place)
        self._bodies = {f"{path}/{body_path(body)}": body for body in moved}
        count = 0
        for body, shape, X_BS, own in _bones(place) if scene_graph is None else _shapes(place, scene_graph):
            where = f"{path}/{body_path(body)}"
            part, count = f"{where}/shape_{count}", count + 1
            meshcat.SetObject(part, shape, own if paint is None else paint)
            meshcat.SetTransform(part, X_BS)
            if paint is not None:  # also for shapes that have colours of their own in their files
                meshcat.SetProperty(part, "opacity", paint.a())
            self._bodies[where] = body

    def put(self, q_rad: Array) -> None:
        """Moves it to joints ``(n,)``."""
        self._positions[self._place.positions] = q_rad
        self._place.plant.SetPositions(self._context, self._positions)
        for where, body in self._bodies.items():
            self._meshcat.SetTransform(where, body.EvalPoseInWorld(self._context))


def _shapes(place: ArmInPlant, scene_graph: SceneGraph) -> Iterator[tuple[Any, Shape, RigidTransform, Rgba]]:
    """Body, shape, its pose on the body, colour."""
    inspector, plain = scene_graph.model_inspector(), _rgba(PLAIN)
    for body in moved_bodies(place):
        for shape in place.plant.GetVisualGeometriesForBody(body):
            properties = inspector.GetIllustrationProperties(shape)
            if properties is not None:
                colour = properties.GetPropertyOrDefault("phong", "diffuse", plain)
                yield body, inspector.GetShape(shape), inspector.GetPoseInFrame(shape), colour


def _bones(place: ArmInPlant) -> Iterator[tuple[Any, Shape, RigidTransform, Rgba]]:
    """The same for a ball at each joint, and a rod from there to the next one, the last to the tool."""
    from pydrake.geometry import Cylinder, Sphere
    from pydrake.math import RigidTransform, RotationMatrix

    context = place.plant.CreateDefaultContext()
    frames = [*(joint.frame_on_parent() for joint in place.arm.joints), place.tool or place.arm.flange]
    p_W = np.array([frame.CalcPoseInWorld(context).translation() for frame in frames])
    lengths = np.linalg.norm(np.diff(p_W, axis=0), axis=1)
    radius = BONE_RADIUS_SHARE * float(lengths.sum())
    for k, joint in enumerate(place.arm.joints):
        body = joint.child_body()
        start, end = (body.EvalPoseInWorld(context).inverse() @ p_W[[k, k + 1]].T).T
        yield body, Sphere(JOINT_BALL * radius), RigidTransform(start), _rgba(PLAIN)
        if lengths[k] > radius:
            along = RotationMatrix.MakeFromOneVector(end - start, 2)
            width = radius * (TOOL_ROD if k == len(lengths) - 1 else 1.0)
            yield body, Cylinder(width, lengths[k]), RigidTransform(along, 0.5 * (start + end)), _rgba(PLAIN)


def moved_bodies(place: ArmInPlant) -> list[Any]:
    """Bodies that the first joint of the arm moves, with all that the arm carries."""
    from pydrake.multibody.tree import BodyIndex, JointIndex

    plant: MultibodyPlant = place.plant
    inboard, first = inboard_joints(plant), int(place.arm.joints[0].index())

    def is_moved(body: Any) -> bool:
        while (j := inboard.get(int(body.index()))) is not None:
            if j == first:
                return True
            body = plant.get_joint(JointIndex(j)).parent_body()
        return False

    return [body for b in range(plant.num_bodies()) if is_moved(body := plant.get_body(BodyIndex(b)))]


def body_path(body: Any) -> str:
    """Where a Drake ``MeshcatVisualizer`` draws a body, below its prefix."""
    return str(body.scoped_name().get_full()).replace("::", "/")


def _rgba(colour: tuple[float, ...]) -> Rgba:
    from pydrake.geometry import Rgba

    return Rgba(*colour)
