"""Which causes a data set speaks for.

The kinematics stays free all the time, being integrated out (``marginal``). Named effects compete with forms of
nameless causes (``nameless``), so that no name is given to what something nameless explains better.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from truepath.contest import Contest
from truepath.context import Context
from truepath.effect_fit import EffectFit, fit_effects, single_rows_apart
from truepath.effects import EFFECTS
from truepath.effects.base import Effect, Term
from truepath.nameless import NAMELESS
from truepath.robust_fit import RobustFit
from truepath.search import Search

MOST = 0.5  # of the rows out of line

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Choice:
    """What was chosen.

    Attributes:
        fit: kinematics, named effects and nameless forms together.
        named: terms of named effects.
        nameless: terms of nameless forms.
        hypotheses: how many effects at how many places and moments were tried.
    """

    fit: EffectFit
    named: tuple[Term, ...]
    nameless: tuple[Term, ...]
    hypotheses: int


def choose(
    kinematic: RobustFit,
    context: Context,
    candidates: Iterable[str] | None = None,
    *,
    nameless: bool = True,
    progress: Progress = lambda _: None,
) -> Choice:
    """Takes effects one after the other, the one with the most evidence first, while they raise it decisively.

    Args:
        kinematic: fit of the kinematics, to the poses to choose by.
        context: of these poses.
        candidates: names of the effects to try; None for all.
        nameless: let nameless forms compete.
        progress: told what is being tried.
    """
    effects: list[Effect] = [EFFECTS[name] for name in (EFFECTS if candidates is None else candidates)]
    effects = [effect for effect in effects if not effect.missing(context)]
    search = _start(kinematic, context, effects)
    contest = Contest(search, effects, [*NAMELESS.values()] if nameless else [], progress)
    contest.run()
    if contest.examine():
        contest.run()
    contest.simplify()
    named = tuple(term for term in search.fit.terms if term.effect in EFFECTS)
    others = tuple(term for term in search.fit.terms if term.effect not in EFFECTS)
    return Choice(search.fit, named, others, sum(search.tried.values()))


def _start(kinematic: RobustFit, context: Context, effects: list[Effect]) -> Search:
    """Where to start: all rows that stand together out of line are let in if one effect brings most of them in line."""
    plain = fit_effects(kinematic, context, ())
    back = single_rows_apart(plain.inlier) & ~plain.inlier
    if back.any() and effects:
        search = Search(kinematic, context, fit_effects(kinematic, context, (), together=True))
        best = max((search.trial(effect) for effect in effects), key=lambda trial: trial.gain)
        if best.terms:
            explained = fit_effects(kinematic, context, best.terms, start=search.fit)
            if explained.sigma[0] < search.fit.sigma[0] and np.mean(explained.inlier[back]) > MOST:
                return search
    return Search(kinematic, context, plain)
