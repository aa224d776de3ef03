"""A model under construction: what another effect would add to it.

The kinematics, and what is in the model already, is integrated out (``marginal``); an effect is judged by the rise
of the marginal likelihood, its sizes being learnt from the data (``evidence``).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from scipy import special

from truepath.context import Context
from truepath.effect_fit import EffectFit, kinematic_prior, linearise
from truepath.effects.base import Effect, Term
from truepath.evidence import LinearProblem, Posterior, infer
from truepath.lie import Array
from truepath.marginal import Marginal
from truepath.robust_fit import RobustFit
from truepath.term_set import TermSet

WORTH_A_LOOK = 0.05  # probability of a group's score by chance, above which it is not even tried
FEW_FORMS, MANY_GROUPS, MOST_PURSUED = 3, 60, 40
AS_GOOD = 0.99  # of the evidence of the best form: one of fewer parameters comes first
LENIENT = 5.0
INVISIBLE = 1e-6  # share of a column's square that must be left when the kinematics is taken out


@dataclass(frozen=True)
class Trial:
    """By how much the log evidence rises with an effect, and those terms of it that are spoken for."""

    name: str
    gain: float = -np.inf
    terms: tuple[Term, ...] = ()

    @property
    def num_parameters(self) -> int:
        """Of all terms."""
        return sum(len(term.parameters) for term in self.terms)


@dataclass
class Search:
    """The state of a search: a model, the readings near it, the terms in it.

    Attributes:
        kinematic: fit of the kinematics alone.
        context: of all its poses.
        fit: the present model.
        tried: hypotheses so far, by effect.
        present: its terms but for those left to be found anew.
        origin: context of the rows that counted in the beginning: what effects are offered by.
        rows, seen: numbers of the rows that count now, and their context.
        chain: where everything is, for these.
        marginal: their readings, with the kinematics and the present terms taken out.
    """

    kinematic: RobustFit
    context: Context
    fit: EffectFit
    tried: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._forms: dict[str, list[TermSet]] = {}
        self._robot = self.kinematic.problem.robot
        self.origin = self.context.subset(self.fit.inlier)
        self.look()

    def look(self, without: Iterable[Term] = ()) -> None:
        """Linearises about the present model; some of its terms can be left to be found anew."""
        rows = np.flatnonzero(self.fit.inlier)
        chosen = self.of_all(self.fit.terms)
        problem, free = self.kinematic.problem, self.kinematic.free
        near = linearise(problem, free, self.context, chosen, self.fit.p, self.fit.values)
        self.rows, self.seen, self.chain = rows, self.context.subset(rows), near.chain.subset(rows)
        self.by_kinematics, self.kinematic_prior = near.kinematics[rows], kinematic_prior(self.kinematic)
        absent = tuple(without)
        self.present = tuple(term for term in self.fit.terms if term not in absent)
        stays = np.array([chosen.terms[t] not in absent for t in chosen.term], bool)
        # What is in the model already is taken out together with the kinematics, at the sizes that were learnt.
        J = np.concatenate([self.by_kinematics, near.effects[rows][:, :, stays]], axis=2)
        prior = np.concatenate([self.kinematic_prior, self.fit.prior_size[stays]])
        self.marginal = Marginal.of(near.y[rows], J, prior, self.fit.sigma)
        self.rigid = self.marginal.first(len(self.kinematic_prior))
        self.left = self.marginal.y
        nothing = self.marginal.problem(np.zeros((*self.left.shape, 0)))
        self.base = self.infer(nothing, TermSet.of(self._robot, self.seen, ()))

    def infer(self, problem: LinearProblem, terms: TermSet, size: Array | None = None) -> Posterior:
        """Sizes and noise for projected columns of some terms."""
        return infer(problem, terms.group, terms.plausible, np.ones(len(terms)), [1.0] * len(problem.count), size)

    def offered(self, terms: TermSet) -> TermSet:
        """Those parameters of terms for all poses that are not in the model yet, for the poses that count."""
        present = {(t.effect, t.joint, t.moves, t.constants): {p.name for p in t.parameters} for t in self.present}
        keep = []
        for term in terms.terms:
            have = present.get((term.effect, term.joint, term.moves, term.constants), set())
            keep += [parameter.name not in have for parameter in term.parameters]
        new = terms if all(keep) else terms.only(np.array(keep, bool))
        return new.rows(self.rows)

    def forms_of(self, effect: Effect) -> list[TermSet]:
        """The effect's alternatives, for all poses; the same all through the search."""
        if effect.name not in self._forms:
            self._forms[effect.name] = [self.of_all(form) for form in effect.alternatives(self._robot, self.origin)]
        return self._forms[effect.name]

    def of_all(self, terms: Iterable[Term]) -> TermSet:
        """Terms for all poses, whether they count or not."""
        return TermSet.of(self._robot, self.context, tuple(terms))

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

    def best_forms(self, effect: Effect) -> list[TermSet]:
        """The most promising of the effect's alternatives, searched coarsely, then finely; all if they are few."""
        forms = self.forms_of(effect)
        self.tried[effect.name] = len(forms) * max((len(form.terms) for form in forms), default=1)
        if len(forms) <= FEW_FORMS:
            return forms
        best = max(forms, key=self._promise)
        fine = [self.of_all(form) for form in effect.refined([*best.terms], self._robot, self.origin)]
        self.tried[effect.name] += len(fine)
        return [max([best, *fine], key=self._promise)]

    def _promise(self, form: TermSet) -> float:
        terms, columns = self.project(self.offered(form), self.rigid)
        if not len(terms):
            return 0.0
        chi2, dof = self.scores(terms, columns)
        return float(np.sum(np.maximum(0.5 * (chi2 - dof * np.log(self.left.size)), 0.0))) + 1e-3 * float(chi2.sum())

    def trial(self, effect: Effect) -> Trial:
        """What an effect would bring, in its best form; in the simplest of those that are as good."""
        trials = [self._try(effect, form) for form in self.best_forms(effect)]
        best = max(trials, key=lambda trial: trial.gain, default=Trial(effect.name))
        as_good = [trial for trial in trials if best.gain > 0 and trial.gain >= AS_GOOD * best.gain]
        return min(as_good, key=lambda trial: (trial.num_parameters, -trial.gain), default=best)

    def _try(self, effect: Effect, form: TermSet) -> Trial:
        # A first look without the effects in the model taken out, which is quick; then a good one.
        terms, columns = self.project(self.offered(form), self.rigid)
        for leniency in (LENIENT, 1.0):
            if leniency == 1.0:
                terms, columns = self.project(terms, self.marginal)
            if not len(terms):
                return Trial(effect.name)
            if len(terms.plausible) > MANY_GROUPS:
                promising = self._pursued(terms, columns)
            else:
                chi2, dof = self.scores(terms, columns)
                promising = special.chdtrc(dof, chi2) < leniency * WORTH_A_LOOK
            terms, columns = terms.only(promising[terms.group]), columns[:, :, promising[terms.group]]
        problem, size = self.marginal.problem(columns), None
        while len(terms):
            posterior = self.infer(problem, terms, size)
            keep = terms.spoken_for(posterior) & terms.possible(posterior.x)
            if keep.all():
                forms = np.log(max(self.tried[effect.name] / len(terms.terms), 1.0))
                gain = posterior.log_evidence - self.base.log_evidence - forms
                return Trial(effect.name, float(gain), terms.terms)
            size = posterior.size[np.unique(terms.group[keep])]
            terms, problem = terms.only(keep), problem.only(keep)
        return Trial(effect.name)

    def explained(self, terms: Iterable[Term]) -> float:
        """Chi-square that stated terms explain of what is left, less the number of their parameters."""
        own, columns = self.project(self.of_all(terms).rows(self.rows), self.marginal)
        if not len(own):
            return 0.0
        X = columns.reshape(self.left.size, -1)
        X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-12)
        values, vectors = np.linalg.eigh(X.T @ X)
        good = values > 1e-9
        b = vectors[:, good].T @ (X.T @ self.left.ravel())
        return float(np.sum(b**2 / values[good])) - int(good.sum())

    def _pursued(self, terms: TermSet, columns: Array) -> Array:
        """``(groups,)`` True for those taken one after the other, the best first (orthogonal matching pursuit).

        To tell the few large ones of many that resemble each other.
        """
        left, X = self.left.ravel().copy(), columns.reshape(self.left.size, -1).copy()
        taken = np.zeros(len(terms.plausible), bool)
        worth = 2.0 * np.log(left.size * len(taken))
        for _ in range(MOST_PURSUED):
            square, along = np.einsum("rk,rk->k", X, X), X.T @ left
            single = np.bincount(terms.group, along**2 / np.maximum(square, 1e-9), len(taken))
            best = int(np.argmax(single))
            if single[best] < worth or taken[best]:
                break
            taken[best] = True
            Q = np.linalg.qr(X[:, terms.group == best])[0]
            left -= Q @ (Q.T @ left)
            X -= Q @ (Q.T @ X)
            X[:, terms.group == best] = 0.0
        return taken

    def gain_of(self, terms: Iterable[Term]) -> float:
        """By how much the log evidence rises with stated terms."""
        wanted, columns = self.project(self.offered(self.of_all(terms)), self.marginal)
        if not len(wanted):
            return -np.inf
        return float(self.infer(self.marginal.problem(columns), wanted).log_evidence - self.base.log_evidence)
