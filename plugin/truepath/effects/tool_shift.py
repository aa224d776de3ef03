"""A probe or reflector that slipped in its holder at one moment."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term
from truepath.effects.shape import Shape
from truepath.effects.steps import clock_of, coarse, moments, near
from truepath.motions import COMPONENTS, Moves
from truepath.robot import NominalRobot


class ToolShift(Effect):
    """From one moment on the probe sits elsewhere on the flange, by (x, y, z, rx, ry, rz) along its axes."""

    name = "tool_shift"
    shapes = (Shape(Moves.PROBE, ("time_s|row",), ("moment",), {"[xyz]": "m", "r[xyz]": "rad"}),)
    driver = "time"
    plausible = "0.02 to 5 mm"
    cause = "reflector, probe or tool slipped in its holder"
    remedy = "fasten it and measure again from that moment on; touch up the tool frame"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        return [[self._at(moment, context)] for moment in coarse(moments(context))]

    def refined(self, terms: list[Term], robot: NominalRobot, context: Context) -> list[list[Term]]:
        return [[self._at(moment, context)] for moment in near(terms[0], context)]

    def _at(self, moment: float, context: Context) -> Term:
        clock = context.clock
        constants = (("moment", float(moment)), (f"default {clock}", float(clock_of(context).max())))
        parameters = tuple(
            EffectParameter(name, "rad", 1e-4, "turn") if "r" in name else EffectParameter(name, "m", 1e-4, "shift")
            for name in COMPONENTS[Moves.PROBE]
        )
        return Term(self.name, Moves.PROBE, None, (clock,), constants, parameters)

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        since = reading[term.inputs[0]] > reading["moment"]
        value = {parameter.name: parameters[i] for i, parameter in enumerate(term.parameters)}
        return ca.vertcat(*(value.get(name, 0.0) * since for name in COMPONENTS[Moves.PROBE]))


EFFECT = ToolShift()
