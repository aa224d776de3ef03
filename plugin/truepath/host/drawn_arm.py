"""An arm of a host's plant, drawn once more in its Meshcat, at joints of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from truepath.arm import inboard_joints
from truepath.host.arm_in_plant import ArmInPlant
from truepath.lie import Array

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat, Rgba, SceneGraph
    from pydrake.multibody.plant import MultibodyPlant

PLAIN = (0.78, 0.79, 0.81, 1.0)  # of shapes that state no colour


class DrawnArm:
    """All that the joints of an arm move, from the illustration geometry of the host's scene graph.

    Has a context of its own: nobody else's is read or changed.

    Args:
        meshcat: to draw in.
        path: below which.
        place: the arm.
        scene_graph: with which its plant is registered; None: there are no shapes, and nothing is drawn.
        paint: colour for all of it, alpha included; None: its own.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        path: str,
        place: ArmInPlant,
        scene_graph: SceneGraph | None,
        paint: Rgba | None = None,
    ) -> None:
        self._meshcat, self._place, plant = meshcat, place, place.plant
        self._context = plant.CreateDefaultContext()
        self._positions = plant.GetPositions(self._context)
        self._bodies: list[tuple[str, Any]] = []
        if scene_graph is None:
            return
        inspector = scene_graph.model_inspector()
        for body in moved_bodies(place):
            where = f"{path}/{body_path(body)}"
            for k, shape in enumerate(plant.GetVisualGeometriesForBody(body)):
                properties = inspector.GetIllustrationProperties(shape)
                if properties is None:
                    continue
                colour = properties.GetPropertyOrDefault("phong", "diffuse", _rgba(PLAIN)) if paint is None else paint
                meshcat.SetObject(f"{where}/shape_{k}", inspector.GetShape(shape), colour)
                meshcat.SetTransform(f"{where}/shape_{k}", inspector.GetPoseInFrame(shape))
                if paint is not None:  # also for shapes that have colours of their own in their files
                    meshcat.SetProperty(f"{where}/shape_{k}", "opacity", paint.a())
            self._bodies.append((where, body))

    def put(self, q_rad: Array) -> None:
        """Moves it to joints ``(n,)``."""
        self._positions[self._place.positions] = q_rad
        self._place.plant.SetPositions(self._context, self._positions)
        for where, body in self._bodies:
            self._meshcat.SetTransform(where, body.EvalPoseInWorld(self._context))


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
