"""A tracker or a pedestal that moved during the campaign: slowly, or at one moment."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term
from truepath.effects.shape import Shape
from truepath.effects.steps import clock_of, coarse, moments, near
from truepath.motions import COMPONENTS, Moves
from truepath.robot import NominalRobot

ORDERS = {1: "1", 2: "2 and 3", 3: "2 and 3", 4: "4 to 6", 5: "4 to 6", 6: "4 to 6"}
FEWEST_ROWS = 24


class FrameDrift(Effect):
    """The base moves by a twist that is a slow function of time, or jumps once.

    Slowly: sum over k of a_k P_k(u), P_k the Legendre polynomials up to order 6 and u the time of the campaign
    from -1 to 1. At once: a (H(t - t0) - share), H the unit step and share that of the poses after the moment t0.
    So X_MB is the mean place during the campaign, and that is what holds where no time is known.
    """

    name = "frame_drift"
    shapes = (
        Shape(Moves.BASE, ("time_s|row",), ("start", "end"), {"[xyz] order [1-6]": "m", "r[xyz] order [1-6]": "rad"}),
        Shape(Moves.BASE, ("time_s|row",), ("moment", "share"), {"[xyz]": "m", "r[xyz]": "rad"}),
    )
    driver = "time"
    plausible = "0.02 to 2 mm, 0.01 to 1 mrad"
    cause = "the tracker, or the pedestal of the robot, moved while poses were measured"
    remedy = "fasten both, let the tracker warm up, measure drift nests now and then; find the frames anew"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        if len(context) < FEWEST_ROWS or np.ptp(clock_of(context)) <= 0:
            return []
        return [[self._slow(context)], *([self._step(moment, context)] for moment in coarse(moments(context)))]

    def refined(self, terms: list[Term], robot: NominalRobot, context: Context) -> list[list[Term]]:
        if "moment" not in dict(terms[0].constants):
            return []
        return [[self._step(moment, context)] for moment in near(terms[0], context)]

    def _slow(self, context: Context) -> Term:
        clock, times = context.clock, clock_of(context)
        constants = (("start", float(times.min())), ("end", float(times.max())))
        parameters = tuple(
            EffectParameter(f"{name} order {k}", *_size(name), f"{_kind(name)}, order {label}")
            for k, label in ORDERS.items()
            for name in COMPONENTS[Moves.BASE]
        )
        return Term(self.name, Moves.BASE, None, (clock,), constants, parameters)

    def _step(self, moment: float, context: Context) -> Term:
        clock = context.clock
        share = float(np.mean(clock_of(context) > moment))
        constants = (("moment", float(moment)), ("share", share))
        parameters = tuple(EffectParameter(name, *_size(name), _kind(name)) for name in COMPONENTS[Moves.BASE])
        return Term(self.name, Moves.BASE, None, (clock,), constants, parameters)

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        time = reading[term.inputs[0]]
        value = {parameter.name: parameters[i] for i, parameter in enumerate(term.parameters)}
        if "moment" in reading:
            since = (time > reading["moment"]) - reading["share"]
            return ca.vertcat(*(value.get(name, 0.0) * since for name in COMPONENTS[Moves.BASE]))
        start, end = reading["start"], reading["end"]
        u = 2.0 * (ca.fmin(ca.fmax(time, start), end) - start) / (end - start) - 1.0
        P = [ca.SX(1), u]
        for k in range(1, max(ORDERS)):
            P.append(((2 * k + 1) * u * P[k] - k * P[k - 1]) / (k + 1))
        return ca.vertcat(
            *(sum(value.get(f"{name} order {k}", 0.0) * P[k] for k in ORDERS) for name in COMPONENTS[Moves.BASE])
        )


def _kind(name: str) -> str:
    return "turn" if "r" in name else "shift"


def _size(name: str) -> tuple[str, float]:
    return ("rad", 1e-4) if "r" in name else ("m", 1e-4)


EFFECT = FrameDrift()
