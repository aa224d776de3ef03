"""An arm in a Drake plant, with frames that are not where the drawing says: the truth that tests compare with."""

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from truepath import plants
from truepath.arm import locate_arm
from truepath.measurements import Measurements


class DrakeArm:
    """Forward kinematics by Drake. W world, B base, F flange.

    Args:
        spec: built-in name or file.
        seed: of hidden errors of 0.4 mm and 0.6 mrad in every joint frame; None for the drawing itself.
    """

    def __init__(self, spec, seed=None):
        self.plant = plants.load_plant(spec)
        self.context = self.plant.CreateDefaultContext()
        self.arm = locate_arm(self.plant)
        if seed is not None:
            rng = np.random.default_rng(seed)
            for joint in self.arm.joints:
                frame = joint.frame_on_parent()
                error = RigidTransform(RollPitchYaw(rng.normal(scale=6e-4, size=3)), rng.normal(scale=4e-4, size=3))
                frame.SetPoseInParentFrame(self.context, frame.GetPoseInParentFrame(self.context) @ error)

    def flange_poses(self, q_rad):
        """``(N, 4, 4)`` poses X_BF."""
        poses = []
        for q in np.atleast_2d(q_rad):
            for joint, angle in zip(self.arm.joints, q, strict=True):
                joint.set_angle(self.context, angle)
            poses.append(self.arm.flange.CalcPose(self.context, self.arm.base).GetAsMatrix4())
        return np.array(poses)

    def measure(self, q_rad, p_FE, noise_mm, seed):
        """What a tracker that stands in the base frame sees of a reflector at ``p_FE`` on the flange."""
        p_BE = self.flange_poses(q_rad) @ [*p_FE, 1.0]
        noise = np.random.default_rng(seed).normal(scale=1e-3 * noise_mm, size=(len(q_rad), 3))
        return Measurements(q_rad=np.array(q_rad), p_ME=p_BE[:, :3] + noise)


def random_joints(robot, count, seed):
    """``(count, n)`` within 90 % of the limits, half a turn at most."""
    lower, upper = (0.9 * np.clip(limit, -np.pi, np.pi) for limit in (robot.lower_rad, robot.upper_rad))
    return np.random.default_rng(seed).uniform(lower, upper, (count, robot.num_joints))
