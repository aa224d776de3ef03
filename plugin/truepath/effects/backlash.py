"""Play of a gear: a joint rests on one flank of its teeth or on the other (Whitney, Lozinski, Rourke 1986)."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term, covered
from truepath.effects.shape import COVERED, Shape
from truepath.lie import Array
from truepath.motions import Moves
from truepath.robot import NominalRobot

LEAST_SHARE = 0.03  # of the poses on the rarer side
LEAST_TORQUE_SPREAD_NM = 0.05
SOFT_SHARE = 0.01  # of the largest torque: within it the joint hangs between the flanks


class Backlash(Effect):
    """delta_phi_i = b_i / 2 times the side on which the joint rests.

    The side is the direction from which the joint arrived, where that was recorded; otherwise the sign of its
    gravity torque, taken as tau / sqrt(tau^2 + tau_0^2), which goes through zero without a jump.
    """

    name = "backlash"
    shapes = (
        Shape(Moves.JOINT, ("approach",), (), {"width": "rad"}),
        Shape(Moves.JOINT, ("gravity_torque",), (*COVERED, "soft_torque"), {"width": "rad"}),
    )
    plausible = "10 to 1000 urad"
    cause = "play in the gear, or friction that winds it up: the joint rests on one side or on the other"
    remedy = "approach poses from one side; have the play of the gear adjusted"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        parameter = EffectParameter("width", "rad", 1e-4, "width")
        torque = robot.gravity_torque(context.q_rad, context.known_payload_kg)
        terms = []
        for i in range(robot.num_joints):
            if context.approach is not None and _has_both_signs(context.approach[:, i]):
                terms.append(Term(self.name, Moves.JOINT, i + 1, ("approach",), (), (parameter,)))
            elif _has_both_signs(torque[:, i]) and torque[:, i].std() > LEAST_TORQUE_SPREAD_NM:
                soft = ("soft_torque", SOFT_SHARE * float(np.abs(torque[:, i]).max()))
                constants = (*covered(context, i + 1), soft)
                terms.append(Term(self.name, Moves.JOINT, i + 1, ("gravity_torque",), constants, (parameter,)))
        return [terms]

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        if term.inputs == ("approach",):
            return 0.5 * parameters[0] * reading["approach"]
        torque = reading["gravity_torque"]
        return 0.5 * parameters[0] * torque / ca.sqrt(torque**2 + reading["soft_torque"] ** 2)

    def makes_sense(self, term: Term, values: Array) -> bool:
        return term.inputs == ("approach",) or bool(values[0] > 0)  # nothing rests against gravity


def _has_both_signs(values: np.ndarray) -> bool:
    return bool(min(np.mean(values > 0), np.mean(values < 0)) >= LEAST_SHARE)


EFFECT = Backlash()
