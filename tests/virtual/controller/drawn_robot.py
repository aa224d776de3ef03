"""The UR5 as drawn, by Drake alone, and small things that the tests of the virtual controller share."""

import time

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix
from truepath import plants

SPEED_UP = 8.0
HOME = [0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0]
TOOL = [0.02, -0.03, 0.15, 0.3, -0.2, 0.4]


class Drawn:
    """The UR5 as drawn: poses of the flange and of tools in its base, by Drake alone."""

    def __init__(self):
        self.plant = plants.load_plant("ur5")
        self.context = self.plant.CreateDefaultContext()

    def flange(self, q_rad):
        self.plant.SetPositions(self.context, q_rad)
        base, flange = self.plant.GetFrameByName("base_link"), self.plant.GetFrameByName("flange")
        return self.plant.CalcRelativeTransform(self.context, base, flange)

    def tool(self, q_rad, tool):
        return self.flange(q_rad) @ transform(tool)


def transform(pose):
    """Drake's transform of position and rotation vector."""
    angle = np.linalg.norm(pose[3:])
    turn = RotationMatrix(AngleAxis(angle, np.array(pose[3:]) / angle)) if angle else RotationMatrix()
    return RigidTransform(turn, pose[:3])


def apart(pose, wanted):
    """Distance, m, and angle, rad, between two poses of the protocols, or Drake's transforms."""
    X, Y = (value if isinstance(value, RigidTransform) else transform(value) for value in (pose, wanted))
    between = X.inverse() @ Y
    return np.linalg.norm(between.translation()), abs(between.rotation().ToAngleAxis().angle())


def until(condition, patience_s=10.0):
    """Waits for something that is to happen."""
    end = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)
