"""Gears and encoders that are not round: a joint error that swings with the joint's own angle.

Ma et al. 2018 describe such errors by polynomials of high order; strain-wave gears and encoder tables show
tens of cycles per turn. Any harmonic content that the data's coverage can resolve is allowed here; how much
there is of which is learnt from the data, band by band.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term, covered
from truepath.motions import Moves
from truepath.robot import NominalRobot

HIGHEST_CYCLES_PER_TURN = 128.0
BAND_EDGES = (0.0, 2.5, 5.0, 10.0, 20.0, 40.0, 80.0, np.inf)  # cycles per turn; a band shares one size
PLAUSIBLE_RAD = 1e-5
FULL_TURN_RAD = np.radians(330.0)
LEAST_RANGE_RAD = np.radians(5.0)
POSES_PER_WAVE = 4  # at least: more waves than that and they are not told from each other


class TransmissionError(Effect):
    """Waves over the joint angle.

    Where a joint was measured over nearly a full turn, delta_phi = sum a_k cos(k theta) + b_k sin(k theta).
    Over a part of a turn of length L from theta_0 these waves are redundant; half waves that fit the part,
    delta_phi = sum a_m cos(pi m (theta - theta_0) / L), carry the same content in fewer parameters.
    """

    name = "transmission_error"
    plausible = "5 to 500 urad, from one to a hundred cycles per turn"
    cause = "gear, encoder or their mounting is out of round"
    remedy = "keep the correction table of this joint; have the gear looked at if the error is out of the usual"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        terms = []
        for joint in range(1, robot.num_joints + 1):
            theta = context.q_rad[:, joint - 1]
            if np.ptp(theta) >= LEAST_RANGE_RAD:
                waves = _waves(float(np.ptp(theta)), len(np.unique(np.round(theta, 5))))
                terms.append(Term(self.name, Moves.JOINT, joint, ("theta",), covered(context, joint), waves))
        return [terms]

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        theta, waves = reading["theta"], []
        for parameter in term.parameters:
            kind, order = parameter.name.split(" ")
            if kind == "half-wave":
                share = (theta - reading["lower_rad"]) / (reading["upper_rad"] - reading["lower_rad"])
                waves.append(ca.cos(np.pi * int(order) * share))
            else:
                waves.append({"cos": ca.cos, "sin": ca.sin}[kind](int(order) * theta))
        return ca.dot(parameters, ca.vertcat(*waves))


def _waves(span: float, different_angles: int) -> tuple[EffectParameter, ...]:
    turns = span / (2 * np.pi)
    waves = min(HIGHEST_CYCLES_PER_TURN * turns, different_angles / POSES_PER_WAVE)
    if span >= FULL_TURN_RAD:
        cycles = range(1, int(waves / max(turns, 1.0)) + 1)
        return tuple(_parameter(f"{kind} {k}", k) for k in cycles for kind in ("cos", "sin"))
    return tuple(_parameter(f"half-wave {m}", 0.5 * m / turns) for m in range(1, int(2 * waves) + 1))


def _parameter(name: str, cycles_per_turn: float) -> EffectParameter:
    band = int(np.searchsorted(BAND_EDGES, cycles_per_turn)) - 1
    label = f"{BAND_EDGES[band]:g} to {BAND_EDGES[band + 1]:g} cycles per turn"
    return EffectParameter(name, "rad", PLAUSIBLE_RAD, label)


EFFECT = TransmissionError()
