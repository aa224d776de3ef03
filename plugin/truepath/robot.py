"""The nominal robot, read from a Drake plant. The one module that reads a ``MultibodyPlant``.

Frames: W world, B robot base, Ai axis i (z along the joint axis), F flange. All quantities are taken
at the zero configuration and expressed in B unless the name says otherwise.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from truepath import lie
from truepath.arm import Arm, inboard_joints, locate_arm
from truepath.lie import Array

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import ModelInstanceIndex, RevoluteJoint
    from pydrake.systems.framework import Context


@dataclass(frozen=True, eq=False)
class NominalRobot:
    """A serial arm of n revolute joints as its maker drew it.

    Attributes:
        name: name of the model, as in the URDF.
        joint_names: n names, base to flange.
        X_BA: ``(n, 4, 4)`` axis frames at zero configuration. z is the joint axis; the origin is that of
            the joint; x is the base axis that is most nearly perpendicular to z, made perpendicular.
        X_BF: ``(4, 4)`` zero pose of the flange (M of the product of exponentials).
        lower_rad, upper_rad, velocity_rad_s, acceleration_rad_s2: ``(n,)`` limits, infinite where the model has none.
        link_mass_kg: ``(n,)`` mass that joint i carries before joint i+1 (tool and reflector with the last).
        p_BoLcm_B: ``(n, 3)`` centre of that mass at the zero configuration, m.
        gravity_B: ``(3,)`` acceleration of gravity in the base frame, m/s^2.
        X_WB: ``(4, 4)`` where the model places the base in its world.
        X_FR: ``(4, 4)`` pose of the frame named ``reflector`` on the flange, None if the model has none.
    """

    name: str
    joint_names: tuple[str, ...]
    X_BA: Array
    X_BF: Array
    lower_rad: Array
    upper_rad: Array
    velocity_rad_s: Array
    acceleration_rad_s2: Array
    link_mass_kg: Array
    p_BoLcm_B: Array
    gravity_B: Array
    X_WB: Array = field(default_factory=lambda: np.eye(4))
    X_FR: Array | None = None

    @property
    def num_joints(self) -> int:
        return len(self.joint_names)

    @property
    def screws_B(self) -> Array:
        """``(n, 6)`` screws xi = (omega, -omega x q) at zero configuration (Jiang et al. 2020, eq. 2 to 4)."""
        omega, point = self.X_BA[:, :3, 2], self.X_BA[:, :3, 3]
        return np.concatenate([omega, -np.cross(omega, point)], axis=1)

    @property
    def model_sha256(self) -> str:
        """Hash of the nominal kinematics, to the nanometre, and of the joints' names.

        Limits, masses and the place in the world do not enter. It seals a calibration file; whether a calibration fits
        a robot is asked of the geometry alone (``same_robot``).
        """
        rounded = [
            (np.round(part, 9) + 0.0).tolist()  # + 0.0 turns -0.0 into 0.0
            for part in (self.screws_B, self.X_BF)
        ]
        text = json.dumps({"joints": list(self.joint_names), "screws": rounded[0], "zero_pose": rounded[1]})
        return hashlib.sha256(text.encode()).hexdigest()

    def gravity_torque(self, q_rad: Array, payload_kg: Array | float = 0.0, p_FP: Array | None = None) -> Array:
        """Torque that gravity exerts about each joint axis, N m.

        Args:
            q_rad: ``(N, n)`` joint angles.
            payload_kg: scalar or ``(N,)`` point mass on the flange, beyond what the model carries.
            p_FP: ``(3,)`` where that mass sits in the flange frame, m; the flange origin if None.

        Returns:
            ``(N, n)``. Same sign as Drake's ``CalcGravityGeneralizedForces``.
        """
        R_BA, moment = self._gravity_moment(q_rad, payload_kg, p_FP)
        return np.einsum("kij,kij->ki", R_BA[..., 2], moment)

    def gravity_moment(self, q_rad: Array, payload_kg: Array | float = 0.0) -> Array:
        """``(N, n, 3)`` moment of gravity about the origin of each axis frame, in that frame before its joint turns."""
        R_BA, moment = self._gravity_moment(q_rad, payload_kg, None)
        return np.einsum("kicj,kic->kij", R_BA, moment)

    def _gravity_moment(self, q_rad: Array, payload_kg: Array | float, p_FP: Array | None) -> tuple[Array, Array]:
        """Orientation of the axis frames ``(N, n, 3, 3)`` and moment about their origins ``(N, n, 3)``, in B."""
        q_rad = np.atleast_2d(q_rad)
        payload = np.broadcast_to(np.asarray(payload_kg, float), q_rad.shape[:1])
        point_0 = self.X_BA[:, :3, 3]
        payload_0 = self.X_BF[:3, 3] if p_FP is None else self.X_BF[:3, :3] @ p_FP + self.X_BF[:3, 3]
        X = np.broadcast_to(np.eye(4), (len(q_rad), 4, 4))
        axes, points, centres = [], [], []
        for i in range(self.num_joints):
            axes.append(X[:, :3, :3] @ self.X_BA[i, :3, :3])
            points.append(X[:, :3, :3] @ point_0[i] + X[:, :3, 3])
            X = X @ rotation_about_axis(self.X_BA[i], q_rad[:, i])
            centres.append(X[:, :3, :3] @ self.p_BoLcm_B[i] + X[:, :3, 3])
        payload_B = X[:, :3, :3] @ payload_0 + X[:, :3, 3]
        # Mass and first moment of everything outboard of joint i, then tau_i = omega_i . (r x m g).
        mass = np.broadcast_to(self.link_mass_kg, q_rad.shape).copy()
        moment = mass[..., None] * np.stack(centres, axis=1)
        mass[:, -1] += payload
        moment[:, -1] += payload[:, None] * payload_B
        mass = np.cumsum(mass[:, ::-1], axis=1)[:, ::-1]
        moment = np.cumsum(moment[:, ::-1], axis=1)[:, ::-1]
        arm = moment - mass[..., None] * np.stack(points, axis=1)
        return np.stack(axes, axis=1), np.cross(arm, self.gravity_B)


def rotation_about_axis(X_BA: Array, angle_rad: Array) -> Array:
    """exp(xi phi) of Jiang et al. 2020, eq. 5: ``(N, 4, 4)`` for the axis frame ``(4, 4)`` and angles ``(N,)``."""
    rotation = lie.from_rotation_vector(np.multiply.outer(angle_rad, X_BA[:3, 2]))
    point = X_BA[:3, 3]
    return lie.make_pose(rotation, point - rotation @ point)


def read_robot(
    plant: MultibodyPlant,
    *,
    model_instance: ModelInstanceIndex | None = None,
    base_frame: str | None = None,
    flange_frame: str | None = None,
) -> NominalRobot:
    """Reads a serial arm of revolute joints out of a finalized plant; arguments and errors as ``arm.locate_arm``."""
    arm = locate_arm(plant, model_instance=model_instance, base_frame=base_frame, flange_frame=flange_frame)
    return describe_arm(plant, arm)


def describe_arm(plant: MultibodyPlant, arm: Arm) -> NominalRobot:
    """The nominal robot that an arm in a plant is."""
    joints = arm.joints
    context = zero_context(plant, arm)
    X_WB = arm.base.CalcPoseInWorld(context).GetAsMatrix4()
    X_BW = lie.invert(X_WB)
    mass, centre = _carried_masses(plant, context, joints)
    return NominalRobot(
        name=plant.GetModelInstanceName(arm.instance),
        joint_names=tuple(joint.name() for joint in joints),
        X_BA=np.stack([_axis_frame(joint, context, X_BW) for joint in joints]),
        X_BF=X_BW @ arm.flange.CalcPoseInWorld(context).GetAsMatrix4(),
        lower_rad=np.array([joint.position_lower_limits()[0] for joint in joints]),
        upper_rad=np.array([joint.position_upper_limits()[0] for joint in joints]),
        velocity_rad_s=np.array([joint.velocity_upper_limits()[0] for joint in joints]),
        acceleration_rad_s2=np.array([joint.acceleration_upper_limits()[0] for joint in joints]),
        link_mass_kg=mass,
        p_BoLcm_B=centre @ X_BW[:3, :3].T + X_BW[:3, 3],
        gravity_B=X_BW[:3, :3] @ plant.gravity_field().gravity_vector(),
        X_WB=X_WB,
        X_FR=_find_reflector(plant, context, arm),
    )


def zero_context(plant: MultibodyPlant, arm: Arm) -> Context:
    """A fresh context with all joints of the arm at zero."""
    context = plant.CreateDefaultContext()
    for joint in arm.joints:
        joint.set_angle(context, 0.0)
    return context


def _axis_frame(joint: RevoluteJoint, context: Context, X_BW: Array) -> Array:
    X_BJ = X_BW @ joint.frame_on_parent().CalcPoseInWorld(context).GetAsMatrix4()
    z = X_BJ[:3, :3] @ joint.revolute_axis()
    z = z / np.linalg.norm(z)
    helper = np.eye(3)[np.argmin(np.round(np.abs(z), 6))]  # rounded: noise must not choose between equals
    x = helper - z * (helper @ z)
    x = x / np.linalg.norm(x)
    return lie.make_pose(np.stack([x, np.cross(z, x), z], axis=1), X_BJ[:3, 3])


def _carried_masses(plant: MultibodyPlant, context: Context, joints: list[RevoluteJoint]) -> tuple[Array, Array]:
    """Mass ``(n,)`` and its centre in the world ``(n, 3)``, grouped by the last chain joint inboard of each body."""
    from pydrake.multibody.tree import BodyIndex, JointIndex

    inboard = inboard_joints(plant)
    position = {int(joint.index()): i for i, joint in enumerate(joints)}
    mass, moment = np.zeros(len(joints)), np.zeros((len(joints), 3))
    for b in range(1, plant.num_bodies()):
        body = walker = plant.get_body(BodyIndex(b))
        while (j := inboard.get(int(walker.index()))) is not None and j not in position:
            walker = plant.get_joint(JointIndex(j)).parent_body()
        if j is None:
            continue
        m = body.get_mass(context)
        if not m > 0:
            continue
        X_WBody = body.EvalPoseInWorld(context)
        mass[position[j]] += m
        moment[position[j]] += m * (X_WBody @ body.CalcCenterOfMassInBodyFrame(context))
    centre = np.divide(moment, mass[:, None], out=np.zeros_like(moment), where=mass[:, None] > 0)
    return mass, centre


def _find_reflector(plant: MultibodyPlant, context: Context, arm: Arm) -> Array | None:
    """Pose on the flange of the frame ``reflector`` that moves rigidly with it, None if there is none."""
    from pydrake.multibody.tree import FrameIndex, JointIndex

    inboard = inboard_joints(plant)
    for index in range(plant.num_frames()):
        frame = plant.get_frame(FrameIndex(index))
        if frame.name() != "reflector":
            continue
        j = inboard.get(int(frame.body().index()))
        while j is not None and plant.get_joint(JointIndex(j)).type_name() == "weld":
            j = inboard.get(int(plant.get_joint(JointIndex(j)).parent_body().index()))
        if j == int(arm.joints[-1].index()):
            return frame.CalcPose(context, arm.flange).GetAsMatrix4()
    return None
