"""Physical causes of robot errors, one file each. A new cause is a new file with an ``EFFECT`` in it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import import_module
from pkgutil import iter_modules

import numpy as np

from truepath.effects.base import Effect, FittedTerm, Term, basis, basis_function
from truepath.errors import InputError
from truepath.lie import Array
from truepath.robot import NominalRobot

EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        import_module(f"{__name__}.{module.name}").EFFECT for module in iter_modules(__path__) if module.name != "base"
    )
}


def effect_named(name: str) -> Effect:
    """The effect of that name; raises InputError that lists what there is."""
    if name not in EFFECTS:
        raise InputError(f"unknown effect {name!r}", expected="one of " + ", ".join(sorted(EFFECTS)))
    return EFFECTS[name]


def is_understood(term: Term) -> bool:
    """Whether the effect can make sense of a term's parameters, which may come from a file."""
    try:
        basis_function(EFFECTS[term.effect], term)
    except (ValueError, LookupError, ArithmeticError, RuntimeError, OverflowError):
        return False
    return True


def terms_of(names: Iterable[str], robot: NominalRobot, q_rad: Array) -> list[Term]:
    """All terms that poses ``(N, n)`` can resolve of the named effects."""
    return [term for name in names for term in effect_named(name).terms(robot, q_rad)]


def context_of(robot: NominalRobot, q_rad: Array, terms: Sequence[Term], payload_kg: Array | float) -> dict[str, Array]:
    """Whatever the terms need to know about poses ``(N, n)``, as ``(N, n)`` arrays by name."""
    needs = {need for term in terms for need in EFFECTS[term.effect].needs}
    context = {}
    if "gravity_torque" in needs:
        context["gravity_torque"] = robot.gravity_torque(q_rad, payload_kg)
    return context


def term_bases(robot: NominalRobot, q_rad: Array, terms: Sequence[Term], payload_kg: Array | float) -> list[Array]:
    """For each term ``(N, k)``: error of its joint in rad per unit of each of its parameters."""
    context = context_of(robot, q_rad, terms, payload_kg)
    return [basis(EFFECTS[term.effect], term, q_rad, context) for term in terms]


def joint_errors(
    robot: NominalRobot, q_rad: Array, fitted: Sequence[FittedTerm], payload_kg: Array | float = 0.0
) -> Array:
    """``(N, n)`` delta_phi of all joints, rad."""
    errors = np.zeros(q_rad.shape)
    bases = term_bases(robot, q_rad, [part.term for part in fitted], payload_kg)
    for part, columns in zip(fitted, bases, strict=True):
        errors[:, part.term.joint - 1] += columns @ part.values
    return errors
