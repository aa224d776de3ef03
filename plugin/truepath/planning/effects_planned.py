"""The terms of named effects as a campaign could resolve them, before it is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from truepath.context import Context
from truepath.effects import effect_named
from truepath.effects.base import EVERYWHERE_RAD, Term
from truepath.errors import InputError
from truepath.lie import Array
from truepath.robot import NominalRobot

MOST_WAVES = 10  # per joint: sine and cosine of one to five cycles a turn; more take hundreds of poses


def planned_terms(robot: NominalRobot, names: Sequence[str], q_rad: Array) -> tuple[tuple[Term, ...], tuple[str, ...]]:
    """Terms to plan poses for, and the names of effects that no choice of poses can show.

    Args:
        robot: nominal robot.
        names: of effects.
        q_rad: ``(k, n)`` poses from all over the workspace.

    Raises:
        InputError: an unknown effect, or one of which these poses could show nothing.
    """
    # Arrivals from either side: what tells play from everything else.
    approach = np.random.default_rng(0).choice([-1.0, 1.0], q_rad.shape)
    context = Context(q_rad, approach=approach)
    terms: list[Term] = []
    others: list[str] = []
    for name in dict.fromkeys(names):
        effect = effect_named(name)
        if effect.driver != "pose" or effect.missing(context):
            others.append(name)
            continue
        found = effect.terms(robot, context)
        if not found:
            raise InputError(
                f"no pose of {robot.name} can show the effect {name!r}", expected="effects that it can have"
            )
        terms += [_everywhere(term.with_parameters(term.parameters[:MOST_WAVES])) for term in found]
    return tuple(terms), tuple(others)


def _everywhere(term: Term) -> Term:
    """Without the fading beyond the joint angles of the poses at hand: the plan shall cover them all."""
    limits = {"lower_rad": -EVERYWHERE_RAD, "upper_rad": EVERYWHERE_RAD}
    return replace(term, constants=tuple((name, limits.get(name, value)) for name, value in term.constants))
