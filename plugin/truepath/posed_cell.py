"""A cell in which a robot stands and can be put at any joints: out of a file, or as a host has it in memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from truepath import plants
from truepath.arm import Arm, locate_arm
from truepath.cell_geometry import floors_as_boxes, place_robot
from truepath.model import CalibratedModel

if TYPE_CHECKING:
    from pydrake.geometry import SceneGraphInspector
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.systems.framework import Context


@dataclass(frozen=True, eq=False)
class PosedCell:
    """Drake's plant and its shapes, with contexts of their own.

    Attributes:
        plant, context: of the cell; the robot's frames are set, all other models stand where they shall.
        arm: which is moved.
        inspector: of the shapes.
        query: answers for the positions that the context has when it is called.
        owner: what must live as long as this.
    """

    plant: MultibodyPlant
    context: Context
    arm: Arm
    inspector: SceneGraphInspector
    query: Callable[[], Any]
    owner: Any = None


class Surroundings(Protocol):
    """What stands around a robot, and can be told by a name."""

    @property
    def file(self) -> Path | None:
        """Where it comes from, for messages; None: from memory."""

    def with_robot(self, model: CalibratedModel) -> PosedCell:
        """The same with a calibrated robot in it.

        Raises:
            InputError: the arm is not the calibrated one, or its frames cannot be set.
        """


@dataclass(frozen=True)
class CellOfAFile:
    """A cell out of a file.

    Attributes:
        spec: built-in name, URDF or directives; of a built-in robot the cell that comes with it.
    """

    spec: str | Path

    @property
    def file(self) -> Path:
        return plants.resolve(plants.cell_of(self.spec))

    def with_robot(self, model: CalibratedModel) -> PosedCell:
        """See ``Surroundings``."""
        from pydrake.systems.framework import DiagramBuilder

        builder = DiagramBuilder()
        plant, scene_graph = plants.add_cell(builder, plants.cell_of(self.spec))
        floors_as_boxes(plant, scene_graph)
        diagram = builder.Build()
        root = diagram.CreateDefaultContext()
        context = plant.GetMyMutableContextFromRoot(root)
        arm = locate_arm(plant)
        place_robot(model, plant, context, arm)
        port = plant.get_geometry_query_input_port()
        # A context belongs to its diagram; both must live as long as this.
        owner = (diagram, root)
        return PosedCell(plant, context, arm, scene_graph.model_inspector(), lambda: port.Eval(context), owner)
