"""The robot behind a hidden cause: perturbed by truepath's virtual cell, moved and weighed by Drake alone."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import free_poses

from hidden_effects.scene import Scene, rotation

SPECS = ("ur5_cell", "ur10_cell")
POOL = 8000
FRESH = 5000  # of the pool, at its end: never part of a campaign


@lru_cache(maxsize=2)
def pool(spec):
    """``(POOL, 6)`` random poses of a cell, free of collision."""
    return free_poses(RealRobot(spec, 0), POOL, np.random.default_rng(20240))


class HiddenRobot:
    """A cell whose frames are off by hidden errors, and which a cause can move further, pose by pose.

    Args:
        spec: a cell with a reflector.
        seed: of the errors, ``imperfection`` their sizes.
    """

    def __init__(self, spec, seed, imperfection):
        self.real = RealRobot(spec, seed, imperfection)
        self.plant = self.real.plant
        self.X_MW = np.eye(4)
        self._context = self.plant.CreateDefaultContext()
        for name, error in self.real.hidden_errors.items():
            frame = self.plant.GetFrameByName(name)
            step = RigidTransform(RollPitchYaw(error["rpy_rad"]), error["translation_m"])
            frame.SetPoseInParentFrame(self._context, frame.GetPoseInParentFrame(self._context) @ step)
        self._joints = [self.plant.GetJointByName(name) for name in self.real.robot.joint_names]
        self._bearings = [joint.frame_on_parent() for joint in self._joints]
        self._X_PJ = [frame.GetPoseInParentFrame(self._context) for frame in self._bearings]
        self._reflector = self.plant.GetFrameByName("reflector")
        self._flange = self.plant.GetFrameByName("flange")
        last = self._joints[-1].child_body()
        welded = self.plant.GetBodiesWeldedTo(last)
        self._bodies = [[joint.child_body()] for joint in self._joints[:-1]] + [welded]

    def survey(self, campaign, span_s):
        """The scene of a campaign, nothing but geometry being wrong; ``span_s`` is the time that drifts refer to."""
        q, payload_kg = campaign.q, campaign.payload_kg
        N, n = q.shape
        X_WE, X_WJ, p_WF = np.empty((N, 4, 4)), np.empty((N, n, 4, 4)), np.empty((N, 3))
        torque, moment = np.empty((N, n)), np.empty((N, n, 3))
        velocity = [joint.velocity_start() for joint in self._joints]
        down_W = self.plant.gravity_field().gravity_vector()
        for k in range(N):
            self._set(q[k])
            X_WE[k] = self._reflector.CalcPoseInWorld(self._context).GetAsMatrix4()
            X_WJ[k] = [frame.CalcPoseInWorld(self._context).GetAsMatrix4() for frame in self._bearings]
            p_WF[k] = self._flange.CalcPoseInWorld(self._context).translation()
            torque[k] = self.plant.CalcGravityGeneralizedForces(self._context)[velocity]
            moment[k] = self._moments(X_WJ[k, :, :3, 3], p_WF[k], payload_kg[k], down_W)
        weight_W = payload_kg[:, None, None] * down_W
        torque += np.sum(X_WJ[..., :3, 2] * np.cross(p_WF[:, None] - X_WJ[..., :3, 3], weight_W), axis=2)
        R = self.X_MW[:3, :3]
        X_ME, X_MJ = self.X_MW @ X_WE, self.X_MW @ X_WJ
        return Scene(
            q=q,
            time_s=campaign.time_s,
            temperature_c=campaign.temperature_c,
            payload_kg=payload_kg,
            approach=campaign.approach,
            span_s=span_s,
            p_ME=X_ME[:, :3, 3],
            R_ME=X_ME[:, :3, :3],
            p_MJ=X_MJ[..., :3, 3],
            R_MJ=X_MJ[..., :3, :3],
            p_MF=p_WF @ R.T + self.X_MW[:3, 3],
            down_M=R @ down_W,
            gravity_torque=torque,
            gravity_moment=moment @ R.T,
        )

    def true_poses(self, scene, motion):
        """``(N, 4, 4)`` X_ME while a cause moves the robot: exact, by Drake (``field`` is its linear part)."""
        poses = np.empty((len(scene), 4, 4))
        moved = np.flatnonzero(motion.bearing.any(axis=(0, 2)))
        for k, q in enumerate(scene.q + motion.joint_rad):
            for i in moved:
                self._bearings[i].SetPoseInParentFrame(self._context, self._X_PJ[i] @ _step(motion.bearing[k, i]))
            self._set(q)
            poses[k] = self._reflector.CalcPoseInWorld(self._context).GetAsMatrix4()
        for i in moved:
            self._bearings[i].SetPoseInParentFrame(self._context, self._X_PJ[i])
        poses[:, :3, 3] += np.einsum("kij,kj->ki", poses[:, :3, :3], motion.probe_m)
        poses = self.X_MW @ poses
        turn = rotation(motion.base[:, :3])
        poses[:, :3] = turn @ poses[:, :3]
        poses[:, :3, 3] += motion.base[:, 3:] + motion.misread_m
        return poses

    def _set(self, q):
        for joint, angle in zip(self._joints, q, strict=True):
            joint.set_angle(self._context, angle)

    def _moments(self, origins, p_WF, payload_kg, down_W):
        """``(n, 3)`` moments of the weight outboard of each joint, in W."""
        mass, first = np.zeros(len(origins)), np.zeros((len(origins), 3))
        for i, bodies in enumerate(self._bodies):
            for body in bodies:
                m = body.get_mass(self._context)
                if m > 0:
                    centre = body.EvalPoseInWorld(self._context) @ body.CalcCenterOfMassInBodyFrame(self._context)
                    mass[i] += m
                    first[i] += m * centre
        mass[-1] += payload_kg
        first[-1] += payload_kg * p_WF
        mass, first = np.cumsum(mass[::-1])[::-1], np.cumsum(first[::-1], axis=0)[::-1]
        return np.cross(first - mass[:, None] * origins, down_W)


def _step(twist):
    return RigidTransform(RotationMatrix(rotation(twist[:3])), twist[3:])
