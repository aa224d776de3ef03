"""Joints that give way under the weight of the arm (Whitney, Lozinski, Rourke 1986)."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term, covered
from truepath.effects.shape import COVERED, Shape
from truepath.lie import Array
from truepath.motions import Moves
from truepath.robot import NominalRobot

LEAST_TORQUE_SPREAD_NM = 0.5  # a torque that hardly changes bends a joint by a constant, which is a zero offset


class JointCompliance(Effect):
    """delta_phi_i = c_i tau_i(theta), tau the gravity torque of arm, tool and payload in N m, c in rad / (N m)."""

    name = "joint_compliance"
    shapes = (Shape(Moves.JOINT, ("gravity_torque",), COVERED, {"compliance": "rad/(N m)"}),)
    plausible = "1e-6 to 1e-4 rad/(N m)"
    cause = "gears and bearings give way under the weight of the arm"
    remedy = "keep the payload that was calibrated; check gear and bearings of a joint that is softer than its peers"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        torque = robot.gravity_torque(context.q_rad, context.known_payload_kg)
        parameter = EffectParameter("compliance", "rad/(N m)", 1e-5, "compliance")
        return [
            [
                Term(self.name, Moves.JOINT, i + 1, ("gravity_torque",), covered(context, i + 1), (parameter,))
                for i in range(robot.num_joints)
                if torque[:, i].std() > LEAST_TORQUE_SPREAD_NM
            ]
        ]

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        return parameters[0] * reading["gravity_torque"]

    def makes_sense(self, term: Term, values: Array) -> bool:
        return bool(values[0] > 0)  # nothing rises under a weight


EFFECT = JointCompliance()
