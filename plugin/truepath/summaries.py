"""The size of a fitted effect in a few words, in units that people use."""

from __future__ import annotations

import math

import numpy as np

from truepath.context import Context
from truepath.effects import motions
from truepath.effects.base import FittedTerm
from truepath.lie import Array
from truepath.motions import COMPONENTS
from truepath.robot import NominalRobot

READABLE = {  # unit of a parameter: factor and name of the unit that people use
    "rad": (1e6, "µrad"),
    "m": (1e6, "µm"),
    "rad/(N m)": (1e6, "µrad/(N m)"),
    "1/K": (1e6, "ppm/K"),
    "m/m": (1e6, "ppm"),
    "rad/rad": (1e6, "ppm"),
}
MOST_CYCLES = 3


def summary(fitted: FittedTerm, context: Context, robot: NominalRobot) -> str:
    """One line: where, how much, when.

    Args:
        fitted: a term with its values.
        context: the poses over which it is judged.
        robot: whose.
    """
    term = fitted.term
    place = f"joint {term.joint}: " if term.joint is not None else ""
    if len(term.parameters) == 1:
        factor, unit = READABLE[term.parameters[0].unit]
        value, sigma = factor * fitted.values[0], factor * fitted.sigma[0]
        told = ""
        if term.effect == "backlash":  # its sign says on which side the joint rests
            side = ("behind", "ahead") if "approach" in term.inputs else ("against gravity", "with gravity")
            told, value = f", the joint rests {side[int(value > 0)]}", abs(value)
        text = f"{place}{term.parameters[0].name} {value:.4g} ± {sigma:.2g} {unit}{told}"
    else:
        text = place + _moved(fitted, motions(robot, context, fitted))
    constants = dict(term.constants)
    if "moment" in constants:
        moment = constants["moment"]
        text += (
            f", from line {math.ceil(moment)} of the file on"
            if "row" in term.inputs
            else f", from t = {moment:.6g} s on"
        )
    if "tau_s" in constants:
        text += f", time constant about {constants['tau_s']:.3g} s"
    polynomials = np.array([parameter.name.startswith("chebyshev ") for parameter in term.parameters])
    if polynomials.any():
        text += ", smooth over the measured range"
    waves = _strongest_waves(fitted, ~polynomials)
    if not waves:
        return text
    return f"{text}, and {waves}" if polynomials.any() else f"{text}, mostly {waves}"


def _moved(fitted: FittedTerm, motion: Array) -> str:
    components = COMPONENTS[fitted.term.moves]
    if "moment" in dict(fitted.term.constants):
        size = np.ptp(motion, axis=0)  # a jump from one value to another
        how = "a step"
    else:
        size, how = motion.std(axis=0), "rms"
    shifts = [i for i, name in enumerate(components) if name in ("x", "y", "z")]
    turns = [i for i in range(len(components)) if i not in shifts]
    parts = []
    for own, unit in ((shifts, "µm"), (turns, "µrad")):
        length = 1e6 * float(np.linalg.norm(size[own])) if own else 0.0
        if length >= 0.05:
            parts.append(f"{length:.3g} {unit}")
    return f"{' and '.join(parts) or 'nothing'} {how}"


def _strongest_waves(fitted: FittedTerm, own: Array) -> str:
    """``1 and 12 cycles per turn``, for effects that are made of waves; those parameters with ``own`` ``(k,)`` True."""
    power: dict[float, float] = {}
    constants = dict(fitted.term.constants)
    parameters = [parameter for parameter, its_own in zip(fitted.term.parameters, own, strict=True) if its_own]
    for parameter, value in zip(parameters, fitted.values[own], strict=True):
        kind, _, order = parameter.name.rpartition(" ")
        if kind.endswith(("cos", "sin")):
            cycles = float(order)
        elif kind == "half-wave" and "lower_rad" in constants:
            cycles = np.pi * float(order) / (constants["upper_rad"] - constants["lower_rad"])
        else:
            return ""
        power[cycles] = power.get(cycles, 0.0) + float(value) ** 2
    if len(power) < (2 if own.all() else 1):  # a single wave without polynomials has said its name already
        return ""
    ranked = sorted(power, key=lambda cycles: -power[cycles])[:MOST_CYCLES]
    strong = sorted(cycles for cycles in ranked if power[cycles] > 0.15 * power[ranked[0]])
    names = [f"{cycles:.2g}" if cycles < 10 else f"{cycles:.0f}" for cycles in strong]
    text = names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
    return f"{text} cycles per turn" if strong != [1.0] else "1 cycle per turn"
