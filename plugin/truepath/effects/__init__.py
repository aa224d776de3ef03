"""Physical causes of robot errors, one file each. A new cause is a new file with an ``EFFECT`` in it."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pkgutil import iter_modules

import numpy as np

from truepath.context import Context
from truepath.effects.base import Cause, Effect, FittedTerm, Term, basis, probe_columns
from truepath.errors import InputError
from truepath.lie import Array
from truepath.motions import ChainPoses, Moves
from truepath.robot import NominalRobot

CAUSES: dict[str, Cause] = {
    cause.name: cause
    for cause in (
        import_module(f"{__name__}.{module.name}").EFFECT
        for module in iter_modules(__path__)
        if module.name not in ("base", "readings", "shape", "steps")
    )
}
EFFECTS: dict[str, Effect] = {name: cause for name, cause in CAUSES.items() if isinstance(cause, Effect)}


def effect_named(name: str) -> Effect:
    """The effect of that name; raises InputError that lists what there is."""
    if name not in EFFECTS:
        raise InputError(f"unknown effect {name!r}", expected="one of " + ", ".join(sorted(EFFECTS)))
    return EFFECTS[name]


def effect_of(term: Term) -> Effect:
    """Whose term it is: a named effect, or one of the forms that a nameless cause can take."""
    if term.effect in EFFECTS:
        return EFFECTS[term.effect]
    from truepath.nameless import NAMELESS

    return NAMELESS[term.effect]


def is_understood(term: Term) -> bool:
    """Whether a term, which may come from a file, is one that its effect can make sense of."""
    return any(shape.fits(term) for shape in EFFECTS[term.effect].shapes)


def motions(robot: NominalRobot, context: Context, fitted: FittedTerm) -> Array:
    """``(N, c)`` size of a fitted term's motion at each pose."""
    return basis(EFFECTS[fitted.term.effect], fitted.term, robot, context) @ fitted.values


def joint_errors(robot: NominalRobot, context: Context, fitted: Sequence[FittedTerm]) -> Array:
    """``(N, n)`` by how much the joints stand off from their commands, rad."""
    errors = np.zeros(context.q_rad.shape)
    for part in fitted:
        if part.term.moves is Moves.JOINT:
            assert part.term.joint is not None
            errors[:, part.term.joint - 1] += motions(robot, context, part)[:, 0]
    return errors


def probe_shift(
    robot: NominalRobot, context: Context, fitted: Sequence[FittedTerm], chain: ChainPoses, kinds: Sequence[Moves]
) -> Array:
    """``(N, 6)`` shift and turn of the probe by the terms that move one of ``kinds``, m and rad, in M."""
    total = np.zeros((len(context), 6))
    for part in fitted:
        if part.term.moves in kinds:
            columns = probe_columns(part.term, basis(EFFECTS[part.term.effect], part.term, robot, context), chain)
            total += columns @ part.values
    return total
