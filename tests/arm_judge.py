"""Drake as the judge of what is read out of its plants."""

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant


class Judge:
    """One arm in one Drake plant, and the questions that the tests ask of Drake."""

    def __init__(self, plant, instance_name, base, flange):
        self.plant, self.context = plant, plant.CreateDefaultContext()
        self.instance = plant.GetModelInstanceByName(instance_name)
        self.base, self.flange = (plant.GetFrameByName(name, self.instance) for name in (base, flange))

    def joints(self, robot):
        return [self.plant.GetJointByName(name, self.instance) for name in robot.joint_names]

    def move(self, robot, q):
        for joint, angle in zip(self.joints(robot), q, strict=True):
            joint.set_angle(self.context, angle)

    def flange_pose(self):
        return self.flange.CalcPose(self.context, self.base).GetAsMatrix4()

    def gravity_torque(self, robot):
        forces = self.plant.CalcGravityGeneralizedForces(self.context)
        return np.array([forces[joint.velocity_start()] for joint in self.joints(robot)])


def load(text, prepare=lambda plant: None):
    """A finalized plant from the text of a URDF, and before that whatever a test wants to add."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, "urdf")
    prepare(plant)
    plant.Finalize()
    return plant


def some_angles(robot, count=20):
    rng = np.random.default_rng(5)
    low, high = np.maximum(robot.lower_rad, -np.pi), np.minimum(robot.upper_rad, np.pi)
    return rng.uniform(low, high, (count, robot.num_joints))
