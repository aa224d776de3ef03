"""From a choice of effects to findings: cross-validated, and told from what could stand in for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from truepath.ambiguity import Confusion, all_confusions
from truepath.calibrate import KinematicFit
from truepath.choose import choose
from truepath.effect_fit import EffectFit, fit_effects
from truepath.effects import EFFECTS
from truepath.effects.base import Term
from truepath.held_out import CrossValidation
from truepath.lie import Array
from truepath.search import Search

LEAST_P = 1e-300  # smaller ones are not told apart
SIGNIFICANT = 0.01  # p value of a finding, all hypotheses that were tried taken into account

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Evidence:
    """What was found on the poses that were looked at.

    Attributes:
        fit: kinematics with the named terms.
        with_doubtful: the same with the named effects that were withdrawn because others could stand in for them.
        named: terms of the findings.
        nameless: terms of nameless forms that passed.
        p_values: of each effect that passed, named or nameless, corrected for the number of hypotheses.
        log_odds: of each effect that passed.
        confusions: what cannot be told apart.
        unproved: names of effects that passed here but did not hold on the poses kept away.
    """

    fit: EffectFit
    with_doubtful: EffectFit
    named: tuple[Term, ...]
    nameless: tuple[Term, ...]
    p_values: dict[str, float]
    log_odds: dict[str, float]
    confusions: tuple[Confusion, ...]
    unproved: tuple[str, ...] = ()


def gather(kinematic: KinematicFit, visits: Array, progress: Progress = lambda _: None) -> Evidence:
    """Chooses effects, cross-validates them, looks for what could stand in for them.

    Args:
        kinematic: fit of the kinematics, to the poses to look at.
        visits: ``(N,)`` number of the pose that each row visits.
        progress: told in plain words what is being done.
    """
    context = kinematic.context
    choice = choose(kinematic.fit, context, progress=progress)
    progress("cross-validating")
    fit, p_values = _validated(kinematic, choice.fit, visits, choice.hypotheses)
    progress("looking for what could stand in for it")
    search = Search(kinematic.fit, context, fit)
    named = tuple(term for term in fit.terms if term.effect in EFFECTS)
    confusions = all_confusions(search, kinematic, named)
    withdrawn = {confusion.withdrawn for confusion in confusions}
    proved = tuple(term for term in named if term.effect not in withdrawn)
    found = fit_effects(kinematic.fit, context, proved, prune=False, start=fit)
    doubtful = found if proved == named else fit_effects(kinematic.fit, context, named, prune=False, start=fit)
    named = proved
    return Evidence(
        fit=found,
        with_doubtful=doubtful,
        named=named,
        nameless=tuple(term for term in fit.terms if term.effect not in EFFECTS),
        p_values=p_values,
        log_odds=fit.log_odds,
        confusions=tuple(confusions),
    )


def _validated(
    kinematic: KinematicFit, fit: EffectFit, visits: Array, hypotheses: int
) -> tuple[EffectFit, dict[str, float]]:
    """The fit without what does not predict held-out readings; the weakest goes first."""
    while True:
        validation = CrossValidation.of(kinematic.fit, kinematic.context, fit)
        by_effect = {
            name: np.isin(validation.place, [t for t, term in enumerate(fit.terms) if term.effect == name])
            for name in fit.log_odds
        }
        by_place = {str(t): validation.place == t for t in range(len(fit.terms))}
        p = validation.p_values({**by_effect, **by_place}, visits[fit.inlier])
        places = {name: sum(term.effect == name for term in fit.terms) for name in by_effect}
        # An effect has to stand against all hypotheses tried; a joint only against the others of its effect.
        corrected = {name: p[name] * hypotheses for name in by_effect}
        corrected |= {str(t): p[str(t)] * places[term.effect] for t, term in enumerate(fit.terms)}
        worst = max(corrected, key=lambda name: corrected[name], default="")
        if not worst or corrected[worst] <= SIGNIFICANT:
            return fit, {name: float(np.clip(corrected[name], LEAST_P, 1.0)) for name in by_effect}
        if worst in by_effect:
            terms = [term for term in fit.terms if term.effect != worst]
        else:
            terms = [term for t, term in enumerate(fit.terms) if str(t) != worst]
        fit = fit_effects(kinematic.fit, kinematic.context, terms, prune=False, start=fit)
