"""Links that grow with temperature."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term
from truepath.effects.shape import Shape
from truepath.motions import Moves
from truepath.robot import NominalRobot

LEAST_SPREAD_K = 0.05


class ThermalExpansion(Effect):
    """All lengths between base and flange grow by alpha (T - T0), T0 the mean temperature of the campaign.

    At a constant temperature this is the same as links of another length, or as a tracker with another scale.
    """

    name = "thermal_expansion"
    shapes = (Shape(Moves.ROBOT_LENGTHS, ("temperature_c",), ("reference_c",), {"expansion": "1/K"}),)
    needs = ("temperature_c",)
    driver = "temperature"
    plausible = "12e-6 per K for steel, 23e-6 per K for aluminium"
    cause = "the links grow and shrink with temperature"
    remedy = "measure and work at one temperature, or record it and let the calibration follow it"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        temperature = context.temperature_c
        if temperature is None or temperature.std() < LEAST_SPREAD_K:
            return []
        mean = float(np.mean(temperature))
        constants = (("reference_c", mean), ("default temperature_c", mean))
        parameter = EffectParameter("expansion", "1/K", 1e-5, "expansion")
        return [[Term(self.name, Moves.ROBOT_LENGTHS, None, ("temperature_c",), constants, (parameter,))]]

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        return parameters[0] * (reading["temperature_c"] - reading["reference_c"])


EFFECT = ThermalExpansion()
