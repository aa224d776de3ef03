"""Bearings that do not run true: what an axis carries tilts or shifts periodically as it turns."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term, covered
from truepath.effects.shape import COVERED, Shape
from truepath.motions import COMPONENTS, Moves
from truepath.robot import NominalRobot

CYCLES = (1, 2, 3)
LEAST_RANGE_RAD = np.radians(20.0)


class AxisWobble(Effect):
    """The body beyond axis i moves by sum over k of a_k cos(k theta_i) + b_k sin(k theta_i), in the axis frame.

    Three components of shift (two of them radial run-out, one axial) and two of tilt. A run-out of one cycle
    that turns with the body is no wobble but a body mounted off centre, which the kinematics already has.
    """

    name = "axis_wobble"
    shapes = (Shape(Moves.AXIS, ("theta",), COVERED, {"[xyz] (cos|sin) [1-3]": "m", "r[xy] (cos|sin) [1-3]": "rad"}),)
    plausible = "5 to 200 um, 5 to 300 urad"
    cause = "the bearing of the axis does not run true: the axis tilts or shifts as it turns"
    remedy = "have the bearing checked for run-out and play"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        parameters = tuple(
            EffectParameter(f"{name} {wave} {k}", *_size(name), f"{'tilt' if 'r' in name else 'shift'} {k}")
            for k in CYCLES
            for name in COMPONENTS[Moves.AXIS]
            for wave in ("cos", "sin")
        )
        return [
            [
                Term(self.name, Moves.AXIS, i + 1, ("theta",), covered(context, i + 1), parameters)
                for i in range(robot.num_joints)
                if np.ptp(context.q_rad[:, i]) > LEAST_RANGE_RAD
            ]
        ]

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        theta = reading["theta"]
        moved = {name: ca.SX(0) for name in COMPONENTS[Moves.AXIS]}
        for i, parameter in enumerate(term.parameters):
            name, wave, cycles = parameter.name.split(" ")
            if name not in moved:
                raise ValueError(f"an axis has no component {name!r}")
            moved[name] += parameters[i] * {"cos": ca.cos, "sin": ca.sin}[wave](int(cycles) * theta)
        return ca.vertcat(*moved.values())


def _size(name: str) -> tuple[str, float]:
    return ("rad", 5e-5) if "r" in name else ("m", 2e-5)


EFFECT = AxisWobble()
