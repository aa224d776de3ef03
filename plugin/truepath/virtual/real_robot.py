"""A "real robot": a Drake plant whose frames are not where the drawing says.

Nothing here uses truepath's own kinematics: every pose is computed by Drake on the perturbed plant.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from truepath import plants
from truepath.arm import locate_arm
from truepath.errors import InputError
from truepath.lie import Array
from truepath.robot import describe_arm

if TYPE_CHECKING:
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import Frame


@dataclass(frozen=True)
class Imperfection:
    """Standard deviations of the hidden errors, per axis: of joint frames, base placement and probe mounting."""

    joint_position_mm: float = 0.4
    joint_rotation_mrad: float = 0.6
    base_position_mm: float = 1.0
    base_rotation_mrad: float = 0.5
    probe_position_mm: float = 0.3


class RealRobot:
    """Moves as a robot with hidden errors would. W world of the cell, E reflector.

    Args:
        spec: a cell whose robot carries a frame ``reflector``, or a built-in robot (its cell is taken).
        seed: of the hidden errors.
        imperfection: their sizes.

    Raises:
        InputError: the cell has no reflector, or the seed is negative.
    """

    def __init__(self, spec: str | Path, seed: int, imperfection: Imperfection | None = None) -> None:
        from pydrake.systems.framework import DiagramBuilder

        if seed < 0:
            raise InputError("a seed cannot be negative", found=str(seed))
        self.spec, self.seed = plants.cell_of(spec), seed
        builder = DiagramBuilder()
        self.plant, self._scene_graph = plants.add_cell(builder, self.spec)
        diagram = builder.Build()
        # A context belongs to its diagram; both must live as long as this.
        self._diagram, self._diagram_context = diagram, diagram.CreateDefaultContext()
        self._context = self.plant.GetMyMutableContextFromRoot(self._diagram_context)
        self._arm = locate_arm(self.plant)
        self.robot = describe_arm(self.plant, self._arm)
        if self.robot.X_FR is None:
            raise InputError(f"the cell {spec} has no frame 'reflector' on its robot")
        self._reflector = self.plant.GetFrameByName("reflector")
        self.hidden_errors = self._perturb(np.random.default_rng(seed), imperfection or Imperfection())

    def reflector_poses(self, q_rad: Array) -> Array:
        """``(N, 4, 4)`` true poses X_WE of the reflector for commanded joints ``(N, n)``."""
        poses = np.empty((len(q_rad), 4, 4))
        for k, q in enumerate(q_rad):  # Drake answers one context at a time
            self._set(q)
            poses[k] = self._reflector.CalcPoseInWorld(self._context).GetAsMatrix4()
        return poses

    def gravity_torques(self, q_rad: Array) -> Array:
        """``(N, n)`` generalized forces of gravity on the joints at ``(N, n)``, N m, by Drake."""
        index = [joint.velocity_start() for joint in self._arm.joints]
        torques = np.empty(q_rad.shape)
        for k, q in enumerate(q_rad):
            self._set(q)
            torques[k] = self.plant.CalcGravityGeneralizedForces(self._context)[index]
        return torques

    def axis_lines(self) -> tuple[Array, Array]:
        """True directions ``(n, 3)`` and points ``(n, 3)`` of the joint axes at zero joints, in W, by Drake."""
        self._set(np.zeros(len(self._arm.joints)))
        frames = [joint.frame_on_parent().CalcPoseInWorld(self._context) for joint in self._arm.joints]
        directions = [X.rotation() @ joint.revolute_axis() for X, joint in zip(frames, self._arm.joints, strict=True)]
        return np.array(directions), np.array([X.translation() for X in frames])

    def is_free(self, q_rad: Array) -> bool:
        """Whether the arm at joints ``(n,)`` touches neither itself nor the cell."""
        self._set(q_rad)
        query = self.plant.get_geometry_query_input_port().Eval(self._context)
        return not query.HasCollisions()

    def _set(self, q_rad: Array) -> None:
        for joint, angle in zip(self._arm.joints, q_rad, strict=True):
            joint.set_angle(self._context, angle)

    def _perturb(self, rng: np.random.Generator, size: Imperfection) -> dict[str, dict[str, list[float]]]:
        """Moves the frames in the plant's context; returns by how much, frame by frame."""
        joint_size = (size.joint_position_mm, size.joint_rotation_mrad)
        frames = [(joint.frame_on_parent(), *joint_size) for joint in self._arm.joints]
        mount = _frame_under(self.plant, self._arm.base)
        if mount is not None:
            frames.append((mount, size.base_position_mm, size.base_rotation_mrad))
        holder = _frame_under(self.plant, self._reflector)
        if holder is not None:
            frames.append((holder, size.probe_position_mm, 0.0))
        errors = {}
        for frame, position_mm, rotation_mrad in frames:
            shift = rng.normal(scale=1e-3 * position_mm, size=3) if position_mm else np.zeros(3)
            turn = rng.normal(scale=1e-3 * rotation_mrad, size=3) if rotation_mrad else np.zeros(3)
            pose = frame.GetPoseInParentFrame(self._context)
            frame.SetPoseInParentFrame(self._context, pose @ _small(shift, turn))
            errors[frame.name()] = {"translation_m": shift.tolist(), "rpy_rad": turn.tolist()}
        return errors


def _small(shift: Array, turn: Array) -> RigidTransform:
    from pydrake.math import RigidTransform, RollPitchYaw

    return RigidTransform(RollPitchYaw(turn), shift)


def _frame_under(plant: MultibodyPlant, frame: Frame) -> Frame | None:
    """The offset frame by which a frame or its body is mounted, if it is one that a context can move."""
    from pydrake.multibody.tree import FixedOffsetFrame

    if isinstance(frame, FixedOffsetFrame):
        return frame
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        on_it = joint.child_body().index() == frame.body().index()
        if on_it and joint.type_name() == "weld" and isinstance(joint.frame_on_parent(), FixedOffsetFrame):
            return joint.frame_on_parent()
    return None
