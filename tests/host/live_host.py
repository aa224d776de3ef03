"""The unseen host with a Meshcat, and what its browser would send and be told."""

from types import SimpleNamespace

import numpy as np
import umsgpack
from foreign_host import X_GT, build_plant, calibrated
from pydrake.geometry import Meshcat, MeshcatParams, MeshcatVisualizer
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

BELOW = "/truepath/right::ur5"
GRIPPER = "right_tool/gripper"
OWN_BUTTON = "of the host"
DRAWN = "visualizer/{side}/ur5/upper_arm_link"  # by the host itself


def start_meshcat():
    """The host's, with something of its own in it."""
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    meshcat.SetTransform("/of_the_host", RigidTransform())
    meshcat.AddButton(OWN_BUTTON)
    return meshcat


def make_host(meshcat, cell):
    """The host's plant with a scene graph and a visualizer, at some pose, and the plugin for its right arm."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    build_plant(plant)
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(root)
    plant.SetPositions(own, np.linspace(-1, 1, plant.num_positions()))
    diagram.ForcedPublish(root)
    plugin = calibrated(plant, cell, meshcat=meshcat)
    return SimpleNamespace(
        plugin=plugin, scene_graph=scene_graph, plant=plant, diagram=diagram, root=root, own=own, meshcat=meshcat
    )


class Browser:
    """What a browser would send, and what it was told."""

    def __init__(self, meshcat):
        self.meshcat = meshcat

    def click(self, label):
        self._send({"type": "button", "name": label})

    def drag(self, label, value):
        self._send({"type": "slider", "name": label, "value": value})

    def _send(self, message):
        self.meshcat._InjectWebsocketMessage(umsgpack.packb(message))

    def pose(self, where):
        """``(4, 4)`` of a node of the tree."""
        packed = umsgpack.unpackb(self.meshcat._GetPackedTransform(where))
        return np.array(packed["matrix"]).reshape(4, 4).T

    def property(self, where, name):
        return umsgpack.unpackb(self.meshcat._GetPackedProperty(where, name))["value"]

    def colours(self, where):
        """``(V, 3)`` colours at the vertices of an object."""
        packed = umsgpack.unpackb(self.meshcat._GetPackedObject(where))
        array = packed["object"]["geometries"][0]["data"]["attributes"]["color"]["array"]
        return np.frombuffer(array.data, np.float32).reshape(-1, 3)

    def tool_of(self, arm):
        """``(3,)`` where the gripper of a drawn arm is."""
        return (self.pose(f"{BELOW}/{arm}/{GRIPPER}") @ X_GT.GetAsMatrix4())[:3, 3]
