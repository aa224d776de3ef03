"""A tracker whose metre is a little too long."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term
from truepath.effects.shape import Shape
from truepath.motions import Moves
from truepath.robot import NominalRobot


class MeasurementScale(Effect):
    """All measured lengths are off by one factor 1 + s.

    A robot whose links are longer by s gives the same readings, so poses alone never prove it.
    """

    name = "measurement_scale"
    shapes = (Shape(Moves.MEASURED_LENGTHS, (), (), {"scale": "m/m"}),)
    plausible = "1e-6 to 1e-3"
    cause = "the scale of the tracker is off, or the refraction of the air was not compensated"
    remedy = "check the tracker against a scale bar; enter temperature and pressure of the air"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        parameter = EffectParameter("scale", "m/m", 1e-4, "scale")
        return [[Term(self.name, Moves.MEASURED_LENGTHS, None, (), (), (parameter,))]]

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        return parameters[0]


EFFECT = MeasurementScale()
