"""The robot that really stands in the cell: nominal kinematics plus what was learnt about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from truepath import lie, poe
from truepath.lie import Array
from truepath.robot import NominalRobot

if TYPE_CHECKING:
    from truepath.effects.base import FittedTerm


@dataclass(frozen=True, eq=False)
class CalibratedModel:
    """Predicts where the real robot goes. Frames: M measurement, B base, F flange, E probe.

    Attributes:
        robot: nominal robot.
        p: ``(4 n + 12,)`` deviations as in ``poe``; the steps of the frames are zero, being part of X_MB, X_FE.
        X_MB, X_FE: ``(4, 4)`` estimated base and probe frame.
        X_MB_nominal, X_FE_nominal: ``(4, 4)`` the same for the nominal robot: as stated, or its best fit.
        base_is_given, tool_is_given: whether that nominal frame was stated.
        effects: what turns joints off from their commands; nothing beyond the joint angles that were measured.
    """

    robot: NominalRobot
    p: Array
    X_MB: Array
    X_FE: Array
    X_MB_nominal: Array
    X_FE_nominal: Array
    base_is_given: bool = False
    tool_is_given: bool = False
    effects: tuple[FittedTerm, ...] = ()

    def true_joints(self, q_rad: Array, payload_kg: Array | float = 0.0) -> Array:
        """``(N, n)`` angles that the joints really take for commands ``(N, n)``, with a payload beyond the model's."""
        q_rad = np.atleast_2d(q_rad)
        if not self.effects:
            return q_rad
        from truepath.effects import joint_errors  # casadi takes a while to import and rigid models need none

        return q_rad + joint_errors(self.robot, q_rad, self.effects, payload_kg)

    def flange_poses(self, q_rad: Array, payload_kg: Array | float = 0.0) -> Array:
        """``(N, 4, 4)`` poses X_BF of the real flange in the real base for commanded joints ``(N, n)``."""
        return poe.flange_poses(self.robot, self.p, self.true_joints(q_rad, payload_kg))

    def flange_poses_and_jacobian(self, q_rad: Array) -> tuple[Array, Array]:
        """The same and its Jacobian ``(N, 6, n)`` (angular, linear velocity of the flange origin, in B).

        The Jacobian is that of the rigid robot at the true angles: effects change it by a few parts in a thousand.
        """
        return poe.flange_poses_and_jacobian(self.robot, self.p, self.true_joints(q_rad))

    def predict(self, q_rad: Array, payload_kg: Array | float = 0.0) -> Array:
        """``(N, 4, 4)`` poses X_ME of the probe that a tracker would see."""
        return self.X_MB @ self.flange_poses(q_rad, payload_kg) @ self.X_FE

    def predict_nominal(self, q_rad: Array, payload_kg: Array | float = 0.0) -> Array:
        """``(N, 4, 4)`` poses X_ME of the probe if the robot were as its maker drew it; no payload bends it."""
        return self.X_MB_nominal @ nominal_flange_poses(self.robot, q_rad) @ self.X_FE_nominal

    def goal_flange_poses(self, X_BF_programmed: Array) -> Array:
        """Where the real flange must be, in the real base, for the tool to be where the program means it.

        A program is written for the nominal robot. If its place in the measurement frame was stated, the
        tool shall arrive at its programmed place there, although the base stands a little elsewhere; if
        nobody knows that place, the estimated base is the only one there is. Likewise for the probe on the
        flange: against a stated mounting, an offset of the probe is an offset of the flange.

        Args, Returns:
            ``(N, 4, 4)``.
        """
        X_BB = lie.invert(self.X_MB) @ self.X_MB_nominal if self.base_is_given else np.eye(4)
        X_FF = self.X_FE_nominal @ lie.invert(self.X_FE) if self.tool_is_given else np.eye(4)
        return X_BB @ X_BF_programmed @ X_FF


def nominal_flange_poses(robot: NominalRobot, q_rad: Array) -> Array:
    """``(N, 4, 4)`` flange poses X_BF of the nominal robot."""
    return poe.flange_poses(robot, no_deviation(robot), q_rad)


def no_deviation(robot: NominalRobot) -> Array:
    """The parameter vector of a perfect robot."""
    return np.zeros(4 * robot.num_joints + 12)


def nominal_model(robot: NominalRobot, X_MB: Array | None = None, X_FE: Array | None = None) -> CalibratedModel:
    """A robot without any deviation, for comparison."""
    X_MB = np.eye(4) if X_MB is None else X_MB
    X_FE = np.eye(4) if X_FE is None else X_FE
    return CalibratedModel(robot, no_deviation(robot), X_MB, X_FE, X_MB, X_FE)
