"""The contest of causes: names first, forms without a name for the rest, and a look back at doubtful names."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from truepath.effect_fit import fit_effects
from truepath.effects import EFFECTS, motions
from truepath.effects.base import Effect, Term, basis
from truepath.search import Search, Trial

LEAST_LOG_ODDS = 10.0  # for an effect: odds of 22,000 to 1, decisive by far (Kass, Raftery 1995)
NAMED_SHARE = 0.5  # of the evidence for a nameless form that a named effect must reach to be above suspicion
JOINT_SHARE = 0.8  # of it that all suspects together must reach
SHADOW_SHARE = 0.25  # of the evidence for a nameless form in the model that a further name must reach,
FAR_SHADOW_SHARE = 0.05  # and one of a joint that the form has nothing to do with
MOST_ROUNDS = 16
ALIKE = 0.6  # correlation
QUIETER = 0.95
ENOUGH_NAMELESS = 3  # rounds: that something is left is known by then
NEARLY = 0.8
WAVES, SIMPLE = ("transmission_error", "axis_wobble"), ("encoder_scale", "joint_compliance", "backlash")

Progress = Callable[[str], None]


@dataclass
class Contest:
    """Takes effects one after the other, the one with the most evidence first, while they raise it decisively.

    No formula of a real cause is perfect, and a form with many parameters can always make up for the rest: so a
    named effect comes before any nameless form. But what explains less than half as much as a nameless form does is
    under suspicion of being its shadow.

    Attributes:
        search: the model so far.
        named, nameless: who takes part.
        progress: told what is being tried.
        suspects: names of effects under suspicion.
        gains: what each brought the last time it was tried. At the same noise that hardly ever rises when another
            comes in, so those that brought little are tried again only when nothing else passes.
        nameless_gain: the most that a nameless form in the model has brought. What little it leaves, because it
            is not quite the right form, is not given a name.
    """

    search: Search
    named: Sequence[Effect]
    nameless: Sequence[Effect]
    progress: Progress
    suspects: set[str] = field(default_factory=set)
    gains: dict[str, float] = field(default_factory=dict)
    nameless_gain: float = 0.0
    _fruitless: set[str] = field(default_factory=set)

    def run(self) -> None:
        """Until nothing more passes."""
        nameless_rounds = 0
        for _ in range(MOST_ROUNDS):
            fresh: dict[str, Trial] = {}
            best = self._best_of(self.named, fresh, LEAST_LOG_ODDS) or self._best_of(self.named, fresh, -np.inf)
            if best is not None and self._is_shadow(best.gain, best.terms):
                best = None
            if best is not None:
                rival = self._best_of(self.nameless, fresh, best.gain / NAMED_SHARE)
                if rival is not None:
                    self.suspects.add(best.name)
            elif nameless_rounds < ENOUGH_NAMELESS:
                best = self._best_of(self.nameless, fresh, LEAST_LOG_ODDS)
                best = best or self._best_of(self.nameless, fresh, -np.inf)
                nameless_rounds += 1
                self.nameless_gain = max(self.nameless_gain, 0.0 if best is None else best.gain)
            if best is None:
                return
            self._take(best)

    def examine(self) -> bool:
        """Drops all suspects if a single nameless form explains more than they do together; True if so."""
        for name in sorted(self.suspects):
            own = [term for term in self.search.fit.terms if term.effect == name]
            self.search.look(without=own)
            if own and self._is_shadow(self.search.gain_of(own), own):
                self._fit([term for term in self.search.fit.terms if term.effect != name])
        self.search.look()
        terms = self.search.fit.terms
        suspects = tuple(term for term in terms if term.effect in self.suspects)
        if not suspects:
            return False
        before = self.search.fit
        self._fit([term for term in terms if term.effect in EFFECTS and term.effect not in self.suspects])
        together = self.search.gain_of(suspects)
        rival = self._best_of(self.nameless, {}, -np.inf)
        if rival is None or together > JOINT_SHARE * rival.gain:
            self.search.fit = before
            self.search.look()
            return False
        self._take(rival)
        self.nameless_gain = max(self.nameless_gain, rival.gain)
        self.gains.clear()
        return True

    def _is_shadow(self, gain: float, terms: Iterable[Term]) -> bool:
        """Whether so little is likely to be what a nameless form in the model leaves, not being quite the right one."""
        elsewhere = {t.joint for t in self.search.fit.terms if t.effect not in EFFECTS}
        near = None in elsewhere or any(term.joint in elsewhere for term in terms)
        return gain < (SHADOW_SHARE if near else FAR_SHADOW_SHARE) * self.nameless_gain

    def simplify(self) -> None:
        """Waves that a cause with a single number explains as well give way to it.

        Waves can imitate anything that depends on the angle of a joint, and come first as long as other causes are
        in the way.
        """
        simple = [effect for effect in self.named if effect.name in SIMPLE]
        for term in self.search.fit.terms:
            if term.effect not in WAVES or not self._may_be_simple(term, simple):
                continue
            self.search.look(without=[term])
            own = self.search.gain_of([term])
            offers = [t for t in self._simple_terms(simple) if t.joint == term.joint]
            gains = {offer.effect: self.search.gain_of([offer]) for offer in offers}
            best = max(gains, key=lambda name: gains[name], default="")
            if best and gains[best] > own:
                others = [t for t in self.search.fit.terms if t is not term]
                self._fit(merged(others, [offer for offer in offers if offer.effect == best]))
            else:
                self.search.look()

    def _may_be_simple(self, term: Term, simple: Iterable[Effect]) -> bool:
        """Whether its motion goes at all with what a simple effect of the same joint would do: quick to see."""
        robot, seen = self.search.kinematic.problem.robot, self.search.seen
        (part,) = (part for part in self.search.fit.effects if part.term is term)
        motion = motions(robot, seen, part)
        for offer in self._simple_terms(simple):
            if offer.joint == term.joint and offer.moves is term.moves:
                like = basis(EFFECTS[offer.effect], offer, robot, seen)[:, 0, 0]
                if abs(np.corrcoef(like, motion[:, 0])[0, 1]) > ALIKE:
                    return True
        return False

    def _simple_terms(self, simple: Iterable[Effect]) -> list[Term]:
        return [term for effect in simple for form in self.search.forms_of(effect) for term in form.terms]

    def _best_of(self, effects: Iterable[Effect], fresh: dict[str, Trial], promise: float) -> Trial | None:
        """The best of those that brought more than ``promise`` the last time, if it passes."""
        able = {effect.name: effect for effect in effects if effect.name not in self._fruitless}
        while stale := [name for name in able if name not in fresh]:
            name = max(stale, key=lambda name: self.gains.get(name, np.inf))
            top = max((trial.gain for trial in fresh.values() if trial.name in able), default=-np.inf)
            if self.gains.get(name, np.inf) < max(top * NEARLY, promise):
                break
            self.progress(f"is there {name.replace('_', ' ')}?")
            fresh[name] = self.search.trial(able[name])
            self.gains[name] = fresh[name].gain
        tried = [fresh[name] for name in able if name in fresh]
        top = max((trial.gain for trial in tried), default=-np.inf)
        if top <= max(LEAST_LOG_ODDS, promise):
            return None
        # A simple cause that brings nearly as much comes first: the rest may well be another one's.
        return min((trial for trial in tried if trial.gain >= NEARLY * top), key=lambda t: (t.num_parameters, -t.gain))

    def _take(self, trial: Trial) -> None:
        before = self.search.fit
        self._fit(merged(before.terms, trial.terms))
        if not set(_places(self.search.fit.terms)) - set(_places(before.terms)):
            self._fruitless.add(trial.name)  # it came and went: no use in trying it again and again

    def _fit(self, terms: Iterable[Term]) -> None:
        search, noise = self.search, self.search.fit.sigma[0]
        search.fit = fit_effects(search.kinematic, search.context, tuple(terms), start=search.fit)
        self.search.look()
        if search.fit.sigma[0] < QUIETER * noise:
            self.gains.clear()  # what was lost in the noise may stand out now


def _places(terms: Iterable[Term]) -> list[tuple]:
    """What is in a model: every parameter of every effect at every place."""
    return [(t.effect, t.moves, t.joint, t.constants, p.name) for t in terms for p in t.parameters]


def merged(old: Iterable[Term], new: Iterable[Term]) -> tuple[Term, ...]:
    """All terms; parameters of the same effect at the same place come together."""
    by_place: dict[tuple, Term] = {}
    for term in (*old, *new):
        place = (term.effect, term.moves, term.joint, term.inputs, term.constants)
        if place in by_place:
            term = term.with_parameters(by_place[place].parameters + term.parameters)
        by_place[place] = term
    return tuple(by_place.values())
