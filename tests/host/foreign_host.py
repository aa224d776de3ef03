"""A host that truepath has never seen: its own Drake plant, written here, and a real robot that differs from it.

Two arms. The left one, a UR5, is welded to the world without a frame of its own. The right one, also a UR5, hangs
askew from a frame that is neither upright nor at the origin, has a camera that pans on its upper arm, in the middle of
the chain of its joints, and carries a gripper from another model. A box lies about, with seven positions of its own.
"""

import re

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, SpatialInertia
from pydrake.systems.framework import BasicVector, LeafSystem
from truepath import plants
from truepath.host import CalibrationPlugin

CAMERA = """
  <link name="camera"><inertial><mass value="0.2"/>
    <inertia ixx="0.0001" ixy="0" ixz="0" iyy="0.0001" iyz="0" izz="0.0001"/></inertial></link>
  <joint name="pan" type="revolute">
    <parent link="upper_arm_link"/><child link="camera"/><origin xyz="-0.2 0 0.2"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/>
  </joint>
"""
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
X_WM = RigidTransform(RollPitchYaw(2.2, 0.4, -1.1), [0.9, -0.6, 1.4])  # where the right arm is mounted
X_FG = RigidTransform(RollPitchYaw(0.1, -0.2, 0.7), [0.01, -0.02, 0.03])  # the gripper on its flange
X_GT = RigidTransform(RollPitchYaw(0.0, 0.5, 0.0), [0.05, 0.02, 0.14])  # where it grips
COMPLIANCE = {1: 3e-5, 2: 5e-5}  # rad per N m, of the lift and the elbow


def urdf_with_camera():
    """The UR5 with a camera that pans, before the elbow among the joints."""
    text = plants.resolve("ur5").read_text()
    return re.sub(r'(\n  <joint name="elbow_joint")', lambda match: CAMERA + match.group(1), text, count=1)


def build_plant(plant=None, furnish=lambda plant: None):
    """A finalized plant. Model instances ``left``, ``right`` (the arms), ``left_tool`` and ``right_tool``.

    ``furnish`` may add to it before.
    """
    plant = MultibodyPlant(0.0) if plant is None else plant
    plant.AddRigidBody("box", SpatialInertia.SolidCubeWithDensity(500.0, 0.1))
    for name in ("left", "right"):
        parser = Parser(plant, name)
        parser.package_map().Add("truepath_models", str(plants.models_dir()))
        parser.SetAutoRenaming(True)
        text = urdf_with_camera() if name == "right" else plants.resolve("ur5").read_text()
        (arm,) = parser.AddModelsFromString(text, "urdf")
        tool = plant.AddModelInstance(f"{name}_tool")
        gripper = plant.AddRigidBody("gripper", tool, SpatialInertia.SolidCubeWithDensity(800.0, 0.1))
        base, flange = plant.GetBodyByName("base_link", arm), plant.GetFrameByName("flange", arm)
        if name == "left":
            plant.WeldFrames(plant.world_frame(), base.body_frame(), RigidTransform([-0.5, 0.3, 0.2]))
            plant.WeldFrames(flange, gripper.body_frame(), X_FG)
        else:
            mount = plant.AddFrame(FixedOffsetFrame("wall", plant.world_frame(), X_WM))
            plant.WeldFrames(mount, base.body_frame())
            holder = plant.AddFrame(FixedOffsetFrame("gripper_mount", flange, X_FG))
            plant.WeldFrames(holder, gripper.body_frame())
        plant.AddFrame(FixedOffsetFrame("tcp", gripper.body_frame(), X_GT, tool))
    furnish(plant)
    plant.Finalize()
    return plant


def arm_instance(plant, side):
    """The model instance of an arm: ``left`` or ``right``."""
    return plant.GetModelInstanceByName(f"{side}::ur5")


def small(rng, shift_m, turn_rad):
    return RigidTransform(RollPitchYaw(rng.normal(scale=turn_rad, size=3)), rng.normal(scale=shift_m, size=3))


class RealCell:
    """The cell as it really is: a plant of its own, in which the frames of the right arm are not where they should be.

    Args:
        seed: of the errors; None: the cell as it is drawn.
        soft: whether two of its joints bend under gravity.
    """

    def __init__(self, seed=None, soft=False):
        self.plant = build_plant()
        self.context = self.plant.CreateDefaultContext()
        self.instance = arm_instance(self.plant, "right")
        self.joints = [self.plant.GetJointByName(f"{name}_joint", self.instance) for name in JOINTS]
        self.tcp = self.plant.GetFrameByName("tcp", self.plant.GetModelInstanceByName("right_tool"))
        self.flange = self.plant.GetFrameByName("flange", self.instance)
        self.compliance = COMPLIANCE if soft else {}
        if seed is not None:
            rng = np.random.default_rng(seed)
            for joint in self.joints:
                self.move(joint.frame_on_parent(), small(rng, 4e-4, 6e-4))
            self.move(self.plant.GetFrameByName("wall"), small(rng, 1e-3, 5e-4))
            self.move(self.plant.GetFrameByName("gripper_mount"), small(rng, 3e-4, 0.0))

    def move(self, frame, X):
        frame.SetPoseInParentFrame(self.context, frame.GetPoseInParentFrame(self.context) @ X)

    def set(self, q):
        """The right arm at commanded joints ``(6,)``."""
        for joint, angle in zip(self.joints, q, strict=True):
            joint.set_angle(self.context, angle)
        if self.compliance:
            torque = self.plant.CalcGravityGeneralizedForces(self.context)
            bent = {i: q[i] + c * torque[self.joints[i].velocity_start()] for i, c in self.compliance.items()}
            for i, angle in bent.items():
                self.joints[i].set_angle(self.context, angle)

    def poses(self, q_rad, frame=None):
        """``(N, 4, 4)`` poses X_WT of the tool (or another frame) in the world."""
        found = []
        for q in np.atleast_2d(q_rad):
            self.set(q)
            found.append((frame or self.tcp).CalcPoseInWorld(self.context).GetAsMatrix4())
        return np.array(found)

    def measure(self, q_rad, seed, noise_mm=0.02):
        """``(N, 3)`` positions of the tool in the world, as a tracker sees them."""
        noise = np.random.default_rng(seed).normal(scale=1e-3 * noise_mm, size=(len(q_rad), 3))
        return self.poses(q_rad)[:, :3, 3] + noise


class RealTool(LeafSystem):
    """Joints sent to the right arm in, position of its real tool out; by Drake on a real cell."""

    def __init__(self, cell, num_inputs, rows):
        super().__init__()
        self.cell, self.rows = cell, rows
        self.DeclareVectorInputPort("sent", num_inputs)
        self.DeclareVectorOutputPort("position", BasicVector(3), self._position)

    def _position(self, context, output):
        q = self.get_input_port(0).Eval(context)[self.rows]
        output.SetFromVector(self.cell.poses(q)[0, :3, 3])


def some_joints(count, seed):
    """``(count, 6)`` well within limits and away from singularities of the wrist."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-2.2, 2.2, (count, 6))
    q[:, 4] = rng.choice([-1.0, 1.0], count) * rng.uniform(0.5, 2.2, count)
    return q


CORNERS = np.array(
    [
        [0.2, -1.3, 1.5, -1.7, 1.3, 0.3],
        [0.6, -1.1, 1.2, -1.4, 1.5, 0.1],
        [0.9, -1.5, 1.7, -1.2, 1.2, -0.4],
        [0.4, -1.7, 1.9, -1.9, 1.0, 0.5],
    ]
)


def path(count):
    """``(count, 6)`` a smooth path of the right arm, clear of singularities."""
    from scipy.interpolate import CubicSpline

    return CubicSpline(np.linspace(0.0, 1.0, len(CORNERS)), CORNERS)(np.linspace(0.0, 1.0, count))


def plugin_for(plant, **options):
    """A plugin for the right arm and its gripper."""
    return CalibrationPlugin(plant, model_instance="right::ur5", tool_frame="tcp", **options)


def calibrated(plant, cell, effects=(), **options):
    """The same, calibrated with a real cell."""
    plugin, q = plugin_for(plant, **options), some_joints(150, 7)
    plugin.calibrate(plugin.measurements(q, cell.measure(q, 8)), effects=effects)
    return plugin
