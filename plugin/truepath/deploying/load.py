"""What hangs on the flange: as the calibration knows it, as the controller and the program state it.

Frame 0: the controller's tool flange.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath import lie, plants
from truepath.calibration import Calibration
from truepath.controller import Controller
from truepath.lie import Array
from truepath.robot import NominalRobot
from truepath.same_robot import what_differs

# A reflector that comes off between measuring and welding weighs less than this, and bends the arm by microns.
MASS_TOLERANCE_KG, MOMENT_TOLERANCE_KG_M = 0.25, 0.02
TOLD_KG = 0.05
BARE_ARMS = ("ur5", "ur10")


@dataclass(frozen=True, eq=False)
class Load:
    """A mass on the flange.

    Attributes:
        mass_kg: all of it, the tool included.
        centre_m: ``(3,)`` in 0; None if nobody says.
    """

    mass_kg: float
    centre_m: Array | None

    def __str__(self) -> str:
        where = "" if self.centre_m is None else f" at ({', '.join(str(round(1e3 * x)) for x in self.centre_m)}) mm"
        return f"{self.mass_kg:.2f} kg{where}"

    def is_a_little_other(self, other: Load) -> bool:
        """Whether somebody should hear of the difference, though it may pass."""
        return self.is_like(other) and abs(self.mass_kg - other.mass_kg) > TOLD_KG

    def is_like(self, other: Load) -> bool:
        """Whether gravity does the same with both, within what a calibration would notice."""
        if not abs(self.mass_kg - other.mass_kg) <= MASS_TOLERANCE_KG:  # not even with a NaN
            return False
        if self.centre_m is None or other.centre_m is None:
            return True
        moment = self.mass_kg * self.centre_m - other.mass_kg * other.centre_m
        return bool(np.linalg.norm(moment) <= MOMENT_TOLERANCE_KG_M)


def calibrated_load(calibration: Calibration, controller: Controller) -> Load | None:
    """What the calibrated robot carries: the tool of its model, and the payload on the flange beyond it.

    Mass and centre of the model's last link, less those of the bare arm. None if no bare arm of that geometry is
    known, so that nobody can tell the tool from the wrist.
    """
    robot = calibration.model.robot
    bare = bare_arm(robot)
    if bare is None:
        return None
    mass = robot.link_mass_kg[-1] - bare.link_mass_kg[-1]
    moment_B = robot.link_mass_kg[-1] * robot.p_BoLcm_B[-1] - bare.link_mass_kg[-1] * bare.p_BoLcm_B[-1]
    X_B0 = robot.X_BF @ controller.X_F0
    payload = calibration.data.payload_kg  # a point at the origin of the flange frame, as in the calibration
    moment_B = moment_B + payload * robot.X_BF[:3, 3]
    total = mass + payload
    if total < 1e-6:
        return Load(0.0, None)
    centre = lie.invert(X_B0) @ np.append(moment_B / total, 1.0)
    return Load(float(total), centre[:3])


def bare_arm(robot: NominalRobot) -> NominalRobot | None:
    for name in BARE_ARMS:
        bare = plants.load_robot(name)
        if not what_differs(bare, robot):
            return bare
    return None
