"""The cells of the repository in Drake, and the questions that tests ask of them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import DiagramBuilder

MODELS = Path(__file__).parents[1] / "models"
ROBOTS = ("ur5", "ur10")
HALF_PI = np.pi / 2
HOME = np.array([0, -HALF_PI, HALF_PI, -HALF_PI, -HALF_PI, 0])


@dataclass
class Cell:
    """A cell with one context, and the questions that the tests ask of it."""

    robot: str

    def __post_init__(self):
        builder = DiagramBuilder()
        self.plant, self.scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        parser = Parser(self.plant)
        parser.SetStrictParsing()
        parser.package_map().Add("truepath_models", str(MODELS))
        parser.AddModels(str(MODELS / self.robot / "cell.dmd.yaml"))
        self.plant.Finalize()
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)

    def pose(self, frame: str, q=None, relative_to: str = "world") -> RigidTransform:
        """Pose of a frame, at q or where the robot stands now."""
        if q is not None:
            self.plant.SetPositions(self.context, q)
        reference = self.plant.GetFrameByName(relative_to)
        return self.plant.GetFrameByName(frame).CalcPose(self.context, reference)

    def flange_jacobian(self, q) -> np.ndarray:
        """Rotation over translation, 6 x 6, in base_link."""
        self.plant.SetPositions(self.context, q)
        base = self.plant.GetFrameByName("base_link")
        return self.plant.CalcJacobianSpatialVelocity(
            self.context,
            JacobianWrtVariable.kQDot,
            self.plant.GetFrameByName("flange"),
            np.zeros(3),
            base,
            base,
        )

    def collisions(self, q) -> set[tuple[str, str]]:
        """Names of the shapes that penetrate each other at q."""
        self.plant.SetPositions(self.context, q)
        query = self.scene_graph.get_query_output_port().Eval(self.scene_graph.GetMyContextFromRoot(self.root))
        name = self.scene_graph.model_inspector().GetName
        return {(name(pair.id_A), name(pair.id_B)) for pair in query.ComputePointPairPenetration()}
