"""Which causes a data set speaks for: forward by evidence, backward by odds, until nothing more passes.

The kinematics stays free all the time, being integrated out (``marginal``). Named effects compete with forms of
nameless causes (``nameless``), so that no name is given to what something nameless explains better.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from scipy import stats

from truepath.context import Context
from truepath.effect_fit import EffectFit, fit_effects, kinematic_prior, linearise
from truepath.effects import EFFECTS
from truepath.effects.base import Effect, Term
from truepath.evidence import LinearProblem, Posterior, infer
from truepath.lie import Array
from truepath.marginal import Marginal
from truepath.nameless import NAMELESS
from truepath.robust_fit import RobustFit
from truepath.term_set import TermSet

LEAST_LOG_ODDS = 10.0  # for an effect: odds of 22,000 to 1, decisive by far (Kass, Raftery 1995)
WORTH_A_LOOK = 0.05  # probability of a group's score by chance, above which it is not even tried
INVISIBLE = 1e-6  # share of a column's square that must be left when the kinematics is taken out
NAMED_SHARE = 0.5  # of the evidence for a nameless form
MOST_ROUNDS = 16

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


@dataclass(frozen=True)
class Trial:
    """By how much the log evidence rises with an effect, and those terms of it that are spoken for."""

    name: str
    gain: float = -np.inf
    terms: tuple[Term, ...] = ()


@dataclass
class Search:
    """The state of a search: a model, the readings near it, the terms in it.

    Attributes:
        kinematic: fit of the kinematics alone.
        context: of all its poses.
        fit: the present model.
        tried: hypotheses so far, by effect.
    """

    kinematic: RobustFit
    context: Context
    fit: EffectFit
    tried: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.look()

    def look(self) -> None:
        """Linearises about the present model."""
        rows = np.flatnonzero(self.fit.inlier)
        robot = self.kinematic.problem.robot
        chosen = TermSet.of(robot, self.context, self.fit.terms)
        problem, free = self.kinematic.problem, self.kinematic.free
        near = linearise(problem, free, self.context, chosen, self.fit.p, self.fit.values)
        self.seen, self.chain = self.context.subset(rows), near.chain.subset(rows)
        self._raw = near.y[rows], near.kinematics[rows], near.effects[rows]
        # What is in the model already is taken out together with the kinematics, at the sizes that were learnt.
        y, J, A, prior = self.raw()
        self.marginal = Marginal.of(y, np.concatenate([J, A], axis=2), prior, self.fit.sigma)
        self.rigid = self.marginal.first(near.kinematics.shape[2])
        self.left = self.marginal.y
        nothing = self.marginal.problem(np.zeros((*self.left.shape, 0)))
        self.base = self.infer(nothing, TermSet.of(robot, self.seen, ()))

    def raw(self) -> tuple[Array, Array, Array, Array]:
        """Readings ``(N, m)``, columns of the kinematics ``(N, m, k)`` and of the effects ``(N, m, K)``, priors."""
        return *self._raw, np.concatenate([kinematic_prior(self.kinematic), self.fit.prior_size])

    def infer(self, problem: LinearProblem, terms: TermSet, size: Array | None = None) -> Posterior:
        """Sizes and noise for projected columns of some terms."""
        return infer(problem, terms.group, terms.plausible, np.ones(len(terms)), [1.0] * len(problem.count), size)

    def offered(self, terms: list[Term]) -> TermSet:
        """Those parameters of the terms that are not in the model yet."""
        present = {(t.effect, t.joint, t.moves, t.constants): {p.name for p in t.parameters} for t in self.fit.terms}
        new = []
        for term in terms:
            have = present.get((term.effect, term.joint, term.moves, term.constants), set())
            parameters = tuple(p for p in term.parameters if p.name not in have)
            if parameters:
                new.append(term.with_parameters(parameters))
        return TermSet.of(self.kinematic.problem.robot, self.seen, new)

    def project(self, terms: TermSet, marginal: Marginal) -> tuple[TermSet, Array]:
        """The columns of terms, those left out that the kinematics imitates."""
        raw = terms.columns(self.chain, len(self.fit.sigma))
        columns = marginal.project(raw)
        whole = np.sum((raw / self.fit.sigma[:, None]) ** 2, axis=(0, 1))
        visible = np.sum(columns**2, axis=(0, 1)) > INVISIBLE * np.maximum(whole, 1e-300)
        return (terms, columns) if visible.all() else (terms.only(visible), columns[:, :, visible])

    def scores(self, terms: TermSet, columns: Array) -> tuple[Array, Array]:
        """Score of each group against what is left, ``(groups,)`` chi-square and degrees of freedom."""
        groups = range(len(terms.plausible))
        chi2, dof = np.zeros(len(groups)), np.zeros(len(groups))
        left = self.left.ravel()
        for group in groups:
            X = columns[:, :, terms.group == group].reshape(len(left), -1)
            H = X.T @ X
            scale = np.sqrt(np.diag(H))
            values, vectors = np.linalg.eigh(H / np.outer(scale, scale))
            good = values > 1e-9 * max(len(values), 1)
            b = vectors[:, good].T @ ((X.T @ left) / scale)
            chi2[group], dof[group] = float(np.sum(b**2 / values[good])), int(good.sum())
        return chi2, dof

    def best_form(self, effect: Effect) -> list[Term]:
        """The most promising of the effect's alternatives, searched coarsely, then finely."""
        robot = self.kinematic.problem.robot
        forms = effect.alternatives(robot, self.seen)
        self.tried[effect.name] = len(forms) * max((len(form) for form in forms), default=1)
        if len(forms) < 2:
            return forms[0] if forms else []
        best = max(forms, key=self._promise)
        fine = effect.refined(best, robot, self.seen)
        self.tried[effect.name] += len(fine)
        return max([best, *fine], key=self._promise)

    def _promise(self, form: list[Term]) -> float:
        terms, columns = self.project(self.offered(form), self.rigid)
        if not len(terms):
            return 0.0
        chi2, dof = self.scores(terms, columns)
        return float(np.sum(np.maximum(0.5 * (chi2 - dof * np.log(self.left.size)), 0.0))) + 1e-3 * float(chi2.sum())

    def trial(self, effect: Effect) -> Trial:
        """What an effect would bring."""
        terms, columns = self.project(self.offered(self.best_form(effect)), self.marginal)
        if not len(terms):
            return Trial(effect.name)
        chi2, dof = self.scores(terms, columns)
        promising = (stats.chi2.sf(chi2, dof) < WORTH_A_LOOK)[terms.group]
        terms, columns = terms.only(promising), columns[:, :, promising]
        problem, size = self.marginal.problem(columns), None
        while len(terms):
            posterior = self.infer(problem, terms, size)
            keep = terms.spoken_for(posterior)
            if keep.all():
                forms = np.log(max(self.tried[effect.name] / len(terms.terms), 1.0))
                gain = posterior.log_evidence - self.base.log_evidence - forms
                return Trial(effect.name, gain, terms.terms)
            size = posterior.size[np.unique(terms.group[keep])]
            terms, problem = terms.only(keep), problem.only(keep)
        return Trial(effect.name)


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
    if nameless:
        effects += NAMELESS.values()
    fruitless: set[str] = set()
    gains = {effect.name: np.inf for effect in effects}
    for _ in range(MOST_ROUNDS):
        best = _next_best(search, [e for e in effects if e.name not in fruitless], gains, progress)
        if best is None:
            break
        before = search.fit
        search.fit = fit_effects(kinematic, context, merged(before.terms, best.terms))
        if not set(_places(search.fit.terms)) - set(_places(before.terms)):
            fruitless.add(best.name)  # it came and went: no use in trying it again and again
        search.look()
    named = tuple(term for term in search.fit.terms if term.effect in EFFECTS)
    others = tuple(term for term in search.fit.terms if term.effect not in EFFECTS)
    return Choice(search.fit, named, others, sum(search.tried.values()))


def _next_best(search: Search, effects: list[Effect], gains: dict[str, float], progress: Progress) -> Trial | None:
    """The trial with the most evidence; a named effect also where a nameless form does somewhat better.

    No formula of a real cause is perfect, and a form with many parameters can always make up for the rest. But
    what explains less than half as much is no explanation, and must not give its name to it.

    What an effect would gain hardly ever rises when another comes in, so those that gained little the last time
    are tried again only when nothing else passes.
    """
    fresh: dict[str, Trial] = {}

    def best_of(kind: list[Effect], thorough: bool) -> Trial | None:
        names = {effect.name: effect for effect in kind}
        while stale := {name for name in names if name not in fresh}:
            name = max(stale, key=lambda name: gains[name])
            top = max((trial.gain for trial in fresh.values() if trial.name in names), default=-np.inf)
            if gains[name] < max(top, -np.inf if thorough else LEAST_LOG_ODDS):
                break
            progress(f"is there {name.replace('_', ' ')}?")
            fresh[name] = search.trial(names[name])
            gains[name] = fresh[name].gain
        return max((fresh[name] for name in names if name in fresh), key=lambda trial: trial.gain, default=None)

    for thorough in (False, True):
        named = best_of([effect for effect in effects if effect.name in EFFECTS], thorough)
        nameless = best_of([effect for effect in effects if effect.name not in EFFECTS], thorough)
        others = nameless.gain if nameless else -np.inf
        if named and named.gain > max(LEAST_LOG_ODDS, NAMED_SHARE * others):
            return named
        if thorough and nameless and others > LEAST_LOG_ODDS:
            return nameless  # now that no name is left to be given
    return None


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
