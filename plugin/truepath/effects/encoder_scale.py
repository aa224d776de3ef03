"""A joint that turns by a little more, or less, than commanded, in proportion."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term, covered
from truepath.effects.shape import COVERED, Shape
from truepath.motions import Moves
from truepath.robot import NominalRobot

LEAST_RANGE_RAD = np.radians(5.0)


class EncoderScale(Effect):
    """delta_phi_i = s_i theta_i."""

    name = "encoder_scale"
    shapes = (Shape(Moves.JOINT, ("theta",), COVERED, {"scale": "rad/rad"}),)
    plausible = "1e-5 to 1e-3"
    cause = "the gear ratio in the controller, or the gain of the encoder, is wrong by a small share"
    remedy = "check gear ratio and encoder resolution in the controller's configuration"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        parameter = EffectParameter("scale", "rad/rad", 1e-4, "scale")
        return [
            [
                Term(self.name, Moves.JOINT, i + 1, ("theta",), covered(context, i + 1), (parameter,))
                for i in range(robot.num_joints)
                if np.ptp(context.q_rad[:, i]) > LEAST_RANGE_RAD
            ]
        ]

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        return parameters[0] * reading["theta"]


EFFECT = EncoderScale()
