"""Whether a reading belongs to the pose at which it was taken, as far as a robot as drawn can tell."""

from __future__ import annotations

import numpy as np

from truepath.errors import CalibrationError
from truepath.frames import register
from truepath.lie import Array
from truepath.model import nominal_model
from truepath.robot import NominalRobot
from truepath.robot_link import RobotFault

FEWEST_VISITS = 6  # 18 numbers for the 9 of base and reflector
FARTHEST_OFF_M = 0.02  # a real robot is off by some millimetres
MOVED_M = 1e-3
SAME_M = 1e-9


class Belonging:
    """Holds each reading against the nominal robot, placed so that it fits all readings of the campaign so far.

    Args:
        robot: as drawn.
    """

    def __init__(self, robot: NominalRobot) -> None:
        self._model = nominal_model(robot)
        self._X_BF, self._p_ME = np.empty((0, 4, 4)), np.empty((0, 3))

    def why_not(self, q_rad: Array, p_ME: Array) -> str:
        """In words why a reading cannot be of this pose; empty if it can, and then it counts from now on.

        Args:
            q_rad: ``(n,)`` commanded joints.
            p_ME: ``(3,)`` the reading, m.

        Raises:
            RobotFault: the tracker says the same at two places; no place of the base fits half of the readings.
        """
        X_BF, p_ME = self._model.predict(q_rad[None]), p_ME[None]
        elsewhere = np.linalg.norm(self._X_BF[:, :3, 3] - X_BF[:, :3, 3], axis=1) > MOVED_M
        if (elsewhere & (np.abs(self._p_ME - p_ME).max(axis=1) < SAME_M)).any():
            raise RobotFault("the tracker says exactly the same at two different poses: its readings are frozen")
        all_X_BF, all_p_ME = np.concatenate([self._X_BF, X_BF]), np.concatenate([self._p_ME, p_ME])
        if len(all_p_ME) >= FEWEST_VISITS:
            try:
                X_MB, X_FE = register(all_X_BF, all_p_ME)
            except CalibrationError as error:
                raise RobotFault(f"the readings do not belong to their poses: {error}") from None
            off_m = np.linalg.norm((X_MB @ all_X_BF @ X_FE)[:, :3, 3] - all_p_ME, axis=1)
            if off_m[-1] > FARTHEST_OFF_M:
                return (
                    f"the reading does not belong to this pose: {1e3 * off_m[-1]:.0f} mm from where the other readings "
                    "have it"
                )
        self._X_BF, self._p_ME = all_X_BF, all_p_ME
        return ""
