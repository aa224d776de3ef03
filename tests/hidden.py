"""Virtual robots with a hidden cause: formulas written here, kinematics and gravity by Drake, nothing of truepath's."""

from dataclasses import dataclass

import numpy as np
from truepath.measurements import Measurements
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import free_poses


@dataclass(frozen=True)
class Hidden:
    """A robot whose joints stray by ``joint_error(q)`` ``(N, n)`` rad, and what a tracker says of it."""

    real: RealRobot
    joint_error: object
    noise_m: float = 2e-5

    def poses(self, count, seed):
        return free_poses(self.real, count, np.random.default_rng(seed))

    def true_positions(self, q):
        return self.real.reflector_poses(q + self.joint_error(q))[:, :3, 3]

    def measured(self, count, seed, *, recorded=False):
        """Positions with noise; with time, temperature, payload and approach if they are to be recorded."""
        q = self.poses(count, seed)
        noise = np.random.default_rng(seed + 1).normal(scale=self.noise_m, size=(count, 3))
        circumstances = {}
        if recorded:
            rng = np.random.default_rng(seed + 2)
            circumstances = {
                "time_s": 12.0 * np.arange(count) + rng.uniform(0, 6, count),
                "temperature_c": 21.0 + 4.0 * rng.random(count),
                "payload_kg": rng.choice([0.0, 2.0], count),
                "approach": rng.choice([-1.0, 1.0], q.shape),
            }
        return Measurements(q, self.true_positions(q) + noise, **circumstances)


def both(*errors):
    """Joint errors that add up."""
    return lambda q: sum(error(q) for error in errors)


def wavy(joint, amplitude_rad, cycles, phase=0.4):
    """A joint (from 1) that swings so many cycles a turn."""

    def error(q):
        delta = np.zeros_like(q)
        delta[:, joint - 1] = amplitude_rad * np.sin(cycles * q[:, joint - 1] + phase)
        return delta

    return error


def soft(real, joint, compliance_rad_nm):
    """A joint (from 1) that bends under gravity, as Drake computes it."""
    plant = real.plant

    def error(q):
        context = plant.CreateDefaultContext()
        joints = [plant.GetJointByName(name) for name in real.robot.joint_names]
        index = joints[joint - 1].velocity_start()
        delta = np.zeros_like(q)
        for k, row in enumerate(q):
            for each, angle in zip(joints, row, strict=True):
                each.set_angle(context, angle)
            delta[k, joint - 1] = compliance_rad_nm * plant.CalcGravityGeneralizedForces(context)[index]
        return delta

    return error


def none(q):
    """No cause at all."""
    return np.zeros_like(q)
