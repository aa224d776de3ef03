"""Gears and encoders that are not round: a joint error that swings with the joint's own angle.

Ma et al. 2018 describe such errors by polynomials of high order; strain-wave gears and encoder tables show
tens of cycles per turn. Both are allowed here, any harmonic content that the data's coverage can resolve included;
how much there is of which is learnt from the data, band by band.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import NEARLY_A_TURN_RAD, Effect, EffectParameter, Term, covered
from truepath.effects.shape import COVERED, Shape
from truepath.lie import Array
from truepath.motions import Moves
from truepath.robot import NominalRobot

HIGHEST_CYCLES_PER_TURN = 128.0
BAND_EDGES = (0.0, 2.5, 5.0, 10.0, 20.0, 40.0, 80.0, np.inf)  # cycles per turn; a band shares one size
PLAUSIBLE_RAD = 1e-5
FULL_TURN = NEARLY_A_TURN_RAD / (2 * np.pi)
LEAST_RANGE_RAD = np.radians(5.0)
HIGHEST_DEGREE = 24
# Degrees of one group share a size. Few groups, so that all are weighed together and none is lost in what the others
# leave. Degree 1 is never alone: a joint error that is a straight line has a name of its own, encoder_scale.
DEGREE_EDGES = (1, 7, 13, HIGHEST_DEGREE + 1)
GAPS_BEYOND = 3.0
WAVE, POLYNOMIAL = r"(cos|sin|half-wave) [1-9]\d{0,3}", r"chebyshev ([1-9]|1\d|2[0-4])"
POSES_PER_WAVE = 1.2  # at least: more waves than that and they are not told from each other

Form = Callable[[float, float], tuple[EffectParameter, ...]]  # of the part of a turn, and of the most waves


class TransmissionError(Effect):
    """Waves, or polynomials, of the joint angle.

    Where a joint was measured over nearly a full turn, delta_phi = sum a_k cos(k theta) + b_k sin(k theta).
    Over a part of a turn of length L from theta_0 these waves are redundant; half waves that fit the part,
    delta_phi = sum a_m cos(pi m (theta - theta_0) / L), carry the same content in fewer parameters.

    An error that is smooth but no wave is a sum of Chebyshev polynomials, delta_phi = sum a_d T_d(x), where x runs
    from -1 to 1 over the measured angles (Ma et al. 2018; Jiang et al. 2020, equations 8 to 10). Half waves, having
    no slope at the ends, come near it only as 1 / m^2.
    """

    name = "transmission_error"
    shapes = (Shape(Moves.JOINT, ("theta",), COVERED, {WAVE: "rad", POLYNOMIAL: "rad"}),)
    plausible = "5 to 500 urad, from one to a hundred cycles per turn"
    cause = "gear, encoder or their mounting is out of round"
    remedy = "keep the correction table of this joint; have the gear looked at if the error is out of the usual"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        """Bands, whose waves share a size: many small waves; single lines: a few large ones; and polynomials.

        A line has a whole number of cycles per turn also where only a part of a turn was measured.
        """
        return [self._form(robot, context, form) for form in (_bands, _lines, _polynomials)]

    def _form(self, robot: NominalRobot, context: Context, form: Form) -> list[Term]:
        terms = []
        for joint in range(1, robot.num_joints + 1):
            theta = context.q_rad[:, joint - 1]
            if np.ptp(theta) >= LEAST_RANGE_RAD:
                turns = float(np.ptp(theta)) / (2 * np.pi)
                most = min(HIGHEST_CYCLES_PER_TURN * turns, len(np.unique(np.round(theta, 5))) / POSES_PER_WAVE)
                limits = _just_beyond(theta) if form is _polynomials else covered(context, joint)
                terms.append(Term(self.name, Moves.JOINT, joint, ("theta",), limits, form(turns, most)))
        return terms

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        theta, shapes = reading["theta"], []
        share = (theta - reading["lower_rad"]) / (reading["upper_rad"] - reading["lower_rad"])
        # Held at its ends: beyond, where effects fade to nothing, a polynomial would grow faster than it fades.
        from_the_end = ca.acos(ca.fmin(ca.fmax(2.0 * share - 1.0, -1.0), 1.0))
        for parameter in term.parameters:
            kind, order = parameter.name.split(" ")
            if kind == "half-wave":
                shapes.append(ca.cos(np.pi * int(order) * share))
            elif kind == "chebyshev":
                shapes.append(ca.cos(int(order) * from_the_end))  # T_d(x) = cos(d arccos x)
            else:
                shapes.append({"cos": ca.cos, "sin": ca.sin}[kind](int(order) * theta))
        return ca.dot(parameters, ca.vertcat(*shapes))


def _bands(turns: float, most: float) -> tuple[EffectParameter, ...]:
    """Waves that fit the range, at most so many."""
    if turns >= FULL_TURN:
        named = [
            (f"{kind} {k}", float(k)) for k in range(1, int(most / max(turns, 1.0)) + 1) for kind in ("cos", "sin")
        ]
    else:
        named = [(f"half-wave {m}", 0.5 * m / turns) for m in range(1, int(2 * most) + 1)]
    band = [int(np.searchsorted(BAND_EDGES, cycles)) - 1 for _, cycles in named]
    return tuple(
        EffectParameter(name, "rad", PLAUSIBLE_RAD, f"{BAND_EDGES[b]:g} to {BAND_EDGES[b + 1]:g} cycles per turn")
        for (name, _), b in zip(named, band, strict=True)
    )


def _lines(turns: float, most: float) -> tuple[EffectParameter, ...]:
    return tuple(
        EffectParameter(f"{kind} {k}", "rad", PLAUSIBLE_RAD, f"{k} cycle{'s' if k > 1 else ''} per turn")
        for k in range(1, int(most / min(turns, 1.0)) + 1)
        for kind in ("cos", "sin")
    )


def _just_beyond(theta: Array) -> tuple[tuple[str, float], ...]:
    """The measured angles and a few times the mean gap between them, so that a pose that is hardly outside counts.

    Also where next to nothing of a turn is missing: unlike waves, polynomials do not come round.
    """
    gap = GAPS_BEYOND * float(np.ptp(theta)) / len(np.unique(np.round(theta, 5)))
    return ("lower_rad", float(theta.min()) - gap), ("upper_rad", float(theta.max()) + gap)


def _polynomials(turns: float, most: float) -> tuple[EffectParameter, ...]:
    """Of no higher degree than half waves would have numbers; a polynomial of degree d has about d half waves."""
    degrees = range(1, min(HIGHEST_DEGREE, int(2 * most)) + 1)
    group = [int(np.searchsorted(DEGREE_EDGES, degree, side="right")) for degree in degrees]
    return tuple(
        EffectParameter(
            f"chebyshev {degree}", "rad", PLAUSIBLE_RAD, f"degrees {DEGREE_EDGES[g - 1]} to {DEGREE_EDGES[g] - 1}"
        )
        for degree, g in zip(degrees, group, strict=True)
    )


EFFECT = TransmissionError()
