"""Nameless forms outside the robot: what the tracker may get wrong, depending on where and how it sees the probe."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import Term
from truepath.effects.readings import polar
from truepath.motions import COMPONENTS, Moves
from truepath.nameless.form import Nameless, harmonics, parameters
from truepath.nameless.in_robot import monomial
from truepath.robot import NominalRobot

FIELD_DEGREES = (1, 2, 3, 4)
HALF_WAVES = 24
BEAM_DEGREES = (1, 2, 3, 4, 5)


def _field(robot: NominalRobot, context: Context) -> list[Term]:
    """A smooth function of the place where the probe is seen."""
    if context.p_ME is None:
        return []
    centre, size = context.p_ME.mean(axis=0), float(np.ptp(context.p_ME, axis=0).max()) / 2
    constants = (("size", size), *((f"c_{name}", float(c)) for name, c in zip("xyz", centre, strict=True)))
    own = tuple(
        parameter
        for degree in FIELD_DEGREES
        for parameter in parameters("xyz", harmonics("p", degree), f"degree {degree}")
    )
    return [Term("place", Moves.READING, None, ("p_x", "p_y", "p_z"), constants, own)]


def _scaled_monomial(feature: str, reading: Mapping[str, ca.SX]) -> ca.SX:
    out = ca.SX(1)
    for name, power in zip("xyz", feature.split(" ")[1:], strict=True):
        out = out * ((reading[f"p_{name}"] - reading[f"c_{name}"]) / reading["size"]) ** int(power)
    return out


def _beam(robot: NominalRobot, context: Context) -> list[Term]:
    """Waves over distance, azimuth and elevation, as the encoders and the distance meter of a tracker make them."""
    if context.p_ME is None:
        return []
    terms = []
    for name, values in polar(context.p_ME).items():
        constants = (("start", float(values.min())), ("end", float(values.max())))
        own = tuple(
            parameter
            for low, high in ((1, 4), (5, 12), (13, HALF_WAVES))
            for parameter in parameters(
                COMPONENTS[Moves.BEAM], [f"{name} {m}" for m in range(low, high + 1)], f"{low} to {high} half waves"
            )
        )
        terms.append(Term("beam", Moves.BEAM, None, (name,), constants, own))
    return terms


def _half_wave(feature: str, reading: Mapping[str, ca.SX]) -> ca.SX:
    name, number = feature.split(" ")
    share = (reading[name] - reading["start"]) / (reading["end"] - reading["start"])
    return ca.cos(np.pi * int(number) * share)


def _incidence(robot: NominalRobot, context: Context) -> list[Term]:
    """What depends on the side from which the beam meets the probe."""
    if context.R_MF is None:
        return []
    own = tuple(
        parameter
        for degree in BEAM_DEGREES
        for parameter in parameters(("distance",), harmonics("beam", degree), f"degree {degree}")
    )
    return [Term("incidence", Moves.BEAM, None, ("beam_x", "beam_y", "beam_z"), (), own)]


FORMS = (
    Nameless("place", "the error goes with the place where the tracker sees the probe", _field, _scaled_monomial),
    Nameless("beam", "the error goes with distance, azimuth or elevation of the tracker's beam", _beam, _half_wave),
    Nameless(
        "incidence", "the error goes with the side from which the tracker's beam meets the probe", _incidence, monomial
    ),
)
