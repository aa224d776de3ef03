"""A robot that was not warm yet: joint zeros, or its lengths, creep towards where they stay."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term
from truepath.effects.shape import Shape
from truepath.motions import Moves
from truepath.robot import NominalRobot

TIME_CONSTANTS = tuple(np.geomspace(0.04, 1.5, 8))  # shares of the campaign
FINER = (0.80, 0.87, 0.93, 1.0, 1.07, 1.15, 1.25)  # times a time constant


class WarmupDrift(Effect):
    """a (1 - exp(-(t - t0) / tau)) for the zero of each joint and for the length of the links, t0 the first pose."""

    name = "warmup_drift"
    shapes = (
        Shape(Moves.JOINT, ("time_s",), ("tau_s", "start", "end"), {"creep": "rad"}),
        Shape(Moves.ROBOT_LENGTHS, ("time_s",), ("tau_s", "start", "end"), {"growth": "m/m"}),
    )
    needs = ("t_s",)
    driver = "time"
    plausible = "20 to 1000 urad per joint, 1e-6 to 1e-4 of the lengths, within minutes to hours"
    cause = "the robot was not warm: gears and links expand until they are"
    remedy = "run the robot for an hour before measuring and before precise work"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        if context.time_s is None or np.ptp(context.time_s) <= 0:
            return []
        return [self._with(share * float(np.ptp(context.time_s)), robot, context) for share in TIME_CONSTANTS]

    def refined(self, terms: list[Term], robot: NominalRobot, context: Context) -> list[list[Term]]:
        return [self._with(terms[0].constant("tau_s") * factor, robot, context) for factor in FINER]

    def _with(self, tau_s: float, robot: NominalRobot, context: Context) -> list[Term]:
        assert context.time_s is not None
        start, end = float(context.time_s.min()), float(context.time_s.max())
        constants = (("tau_s", tau_s), ("start", start), ("end", end), ("default time_s", end))
        creep = (EffectParameter("creep", "rad", 1e-4, "creep"),)
        growth = (EffectParameter("growth", "m/m", 1e-5, "growth"),)
        joints = [Term(self.name, Moves.JOINT, i + 1, ("time_s",), constants, creep) for i in range(robot.num_joints)]
        return [*joints, Term(self.name, Moves.ROBOT_LENGTHS, None, ("time_s",), constants, growth)]

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        time = ca.fmin(ca.fmax(reading["time_s"], reading["start"]), reading["end"])
        return parameters[0] * (1.0 - ca.exp(-(time - reading["start"]) / reading["tau_s"]))


EFFECT = WarmupDrift()
