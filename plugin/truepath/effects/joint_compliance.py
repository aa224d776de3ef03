"""Joints that give way under the weight of the arm (Whitney, Lozinski, Rourke 1986)."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from truepath.effects.base import Effect, EffectParameter, Term
from truepath.lie import Array
from truepath.robot import NominalRobot

LEAST_TORQUE_SPREAD_NM = 0.5  # a torque that hardly changes bends a joint by a constant, which is a zero offset


class JointCompliance(Effect):
    """delta_phi_i = c_i tau_i(theta), tau the gravity torque of arm, tool and payload in N m, c in rad / (N m)."""

    name = "joint_compliance"
    needs = ("gravity_torque",)
    cause = "gears and bearings give way under the weight of the arm"
    remedy = "keep the payload that was calibrated; check gear and bearings of a joint that is softer than its peers"

    def terms(self, robot: NominalRobot, q_rad: Array) -> list[Term]:
        torque = robot.gravity_torque(q_rad)
        return [
            Term(
                self.name,
                i + 1,
                float(q_rad[:, i].min()),
                float(q_rad[:, i].max()),
                (EffectParameter("compliance", "rad/(N m)", 1e-5, "compliance"),),
            )
            for i in range(robot.num_joints)
            if torque[:, i].std() > LEAST_TORQUE_SPREAD_NM
        ]

    def joint_error(self, term: Term, theta: ca.SX, context: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        return parameters[0] * context["gravity_torque"]


EFFECT = JointCompliance()
