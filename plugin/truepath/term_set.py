"""The parameters of several terms in a row: their columns, their groups, what of them the data speaks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truepath.context import Context
from truepath.effects import effect_of
from truepath.effects.base import FittedTerm, Term, basis, probe_columns
from truepath.evidence import Posterior
from truepath.lie import Array
from truepath.motions import ChainPoses, Moves
from truepath.robot import NominalRobot

LEAST_LOG_ODDS_GROUP = 1.0  # for a band of waves or the like to stay
LEAST_LOG_ODDS_TERM = 7.0  # for a joint to be named


@dataclass(frozen=True)
class TermSet:
    """K parameters of some terms, for N poses.

    Attributes:
        terms: the terms, each with those of its parameters that are still there.
        bases: one ``(N, c, k)`` per term, its motion per unit of each parameter.
        term: ``(K,)`` number of the term of each parameter.
        group: ``(K,)`` number of the group of each.
        plausible: ``(groups,)`` plausible size of each group.
    """

    terms: tuple[Term, ...]
    bases: tuple[Array, ...]
    term: Array
    group: Array
    plausible: Array

    @classmethod
    def of(cls, robot: NominalRobot, context: Context, terms: Sequence[Term]) -> TermSet:
        """All parameters of all terms."""
        return cls._with(tuple(terms), tuple(basis(effect_of(term), term, robot, context) for term in terms))

    @classmethod
    def _with(cls, terms: tuple[Term, ...], bases: tuple[Array, ...]) -> TermSet:
        labels = [(t, parameter.group) for t, term in enumerate(terms) for parameter in term.parameters]
        scales = [parameter.prior_scale for term in terms for parameter in term.parameters]
        numbers = {label: number for number, label in enumerate(dict.fromkeys(labels))}
        plausible = np.zeros(len(numbers))
        for label, scale in zip(labels, scales, strict=True):
            plausible[numbers[label]] = scale
        term_of, group_of = [t for t, _ in labels], [numbers[label] for label in labels]
        return cls(terms, bases, np.array(term_of, int), np.array(group_of, int), plausible)

    def __len__(self) -> int:
        return len(self.group)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects, each once."""
        return tuple(dict.fromkeys(term.effect for term in self.terms))

    def of_effect(self, name: str) -> Array:
        """``(K,)`` True for the parameters of an effect."""
        return np.array([self.terms[t].effect == name for t in self.term], bool)

    def only(self, keep: Array) -> TermSet:
        """Without the parameters for which ``keep`` ``(K,)`` is False."""
        terms, bases = [], []
        for t, (term, columns) in enumerate(zip(self.terms, self.bases, strict=True)):
            own = keep[self.term == t]
            if own.any():
                terms.append(term.with_parameters(tuple(p for p, k in zip(term.parameters, own, strict=True) if k)))
                bases.append(columns if own.all() else columns[:, :, own])
        return TermSet._with(tuple(terms), tuple(bases))

    def rows(self, rows: Array) -> TermSet:
        """For some of the poses."""
        return TermSet(self.terms, tuple(b[rows] for b in self.bases), self.term, self.group, self.plausible)

    def columns(self, chain: ChainPoses, components: int) -> Array:
        """``(N, m, K)`` derivative of the predicted reading, m and rad."""
        parts = [probe_columns(t, b, chain)[:, :components] for t, b in zip(self.terms, self.bases, strict=True)]
        return np.concatenate(parts, axis=2) if parts else np.zeros((len(chain.X_ME), components, 0))

    def joint_error(self, values: Array, num_poses: int, num_joints: int) -> Array:
        """``(N, n)`` rad by which joints stand off."""
        error = np.zeros((num_poses, num_joints))
        for t, (term, columns) in enumerate(zip(self.terms, self.bases, strict=True)):
            if term.moves is Moves.JOINT:
                assert term.joint is not None
                error[:, term.joint - 1] += columns[:, 0] @ values[self.term == t]
        return error

    def moves_no_joint(self) -> Array:
        """``(K,)`` True for parameters that do not enter through the joint angles."""
        return np.array([self.terms[t].moves is not Moves.JOINT for t in self.term], bool)

    def log_odds(self, own: Array, posterior: Posterior, first: int = 0) -> float:
        """For the parameters with ``own`` ``(K,)`` True against their absence; theirs start at ``first``."""
        groups = self.group[own]
        return posterior.log_odds(first + np.flatnonzero(own), posterior.size[groups], len(np.unique(groups)))

    def spoken_for(self, posterior: Posterior, first: int = 0) -> Array:
        """``(K,)`` False for the parameters that are the next to go, because the data does not speak for them.

        Groups of one term can stand in for each other, so only the weakest of each term goes at a time; when no
        group has to go any more, the weakest term.
        """
        keep = np.ones(len(self), bool)
        for t in range(len(self.terms)):
            groups = np.unique(self.group[self.term == t])
            odds = [self.log_odds(self.group == group, posterior, first) for group in groups]
            if min(odds) < LEAST_LOG_ODDS_GROUP:
                keep[self.group == groups[int(np.argmin(odds))]] = False
        if keep.all() and self.terms:
            odds = [self.log_odds(self.term == t, posterior, first) for t in range(len(self.terms))]
            if min(odds) < LEAST_LOG_ODDS_TERM:
                keep[self.term == int(np.argmin(odds))] = False
        return keep

    def possible(self, values: Array) -> Array:
        """``(K,)`` False for the parameters of terms whose values ``(K,)`` make no physical sense."""
        keep = np.ones(len(self), bool)
        for t, term in enumerate(self.terms):
            own = self.term == t
            keep[own] = effect_of(term).makes_sense(term, values[own])
        return keep

    def fitted(self, values: Array, sigma: Array) -> tuple[FittedTerm, ...]:
        """The terms with their values ``(K,)`` and standard deviations ``(K,)``."""
        ends = np.cumsum([0, *(len(term.parameters) for term in self.terms)])
        return tuple(
            FittedTerm(term, values[a:b], sigma[a:b]) for term, (a, b) in zip(self.terms, pairwise(ends), strict=True)
        )
