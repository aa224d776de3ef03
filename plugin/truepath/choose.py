"""Which causes a data set speaks for.

The kinematics stays free all the time, being integrated out (``marginal``). Named effects compete with forms of
nameless causes (``nameless``), so that no name is given to what something nameless explains better.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from truepath.contest import Contest
from truepath.context import Context
from truepath.effect_fit import EffectFit, fit_effects
from truepath.effects import EFFECTS
from truepath.effects.base import Effect, Term
from truepath.nameless import NAMELESS
from truepath.robust_fit import RobustFit
from truepath.search import Search

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
    search = Search(kinematic, context, fit_effects(kinematic, context, ()))
    effects: list[Effect] = [EFFECTS[name] for name in (EFFECTS if candidates is None else candidates)]
    effects = [effect for effect in effects if not effect.missing(context)]
    contest = Contest(search, effects, [*NAMELESS.values()] if nameless else [], progress)
    contest.run()
    if contest.examine():
        contest.run()
    contest.simplify()
    named = tuple(term for term in search.fit.terms if term.effect in EFFECTS)
    others = tuple(term for term in search.fit.terms if term.effect not in EFFECTS)
    return Choice(search.fit, named, others, sum(search.tried.values()))
