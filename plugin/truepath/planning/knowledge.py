"""What a data set has told already, for planning what to measure next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath.calibrate import KinematicFit
from truepath.context import Context
from truepath.effect_fit import EffectFit, kinematic_prior, linearise
from truepath.effects.base import Term
from truepath.effects.steps import clock_of
from truepath.lie import Array
from truepath.planning.information import ReadingModel
from truepath.term_set import TermSet


@dataclass(frozen=True, eq=False)
class Knowledge:
    """A fit and what its data says of K parameters.

    Attributes:
        model: of the readings, about the fit.
        information: ``(K, K)`` of the data, priors not included, in units of ``model.widths``.
    """

    model: ReadingModel
    information: Array

    @classmethod
    def of(cls, kinematic: KinematicFit, fit: EffectFit, terms: Sequence[Term]) -> Knowledge:
        """From a fit to the data so far.

        Args:
            kinematic: the fit of the kinematics.
            fit: the present model.
            terms: what has to be known, or told apart: terms of the model and others.
        """
        robot, context, problem = kinematic.robot, kinematic.context, kinematic.fit.problem
        learnt = {_place(part.term): part for part in fit.effects}
        sizes = np.split(fit.prior_size, np.cumsum([len(part.values) for part in fit.effects])[:-1])
        size_of = dict(zip(learnt, sizes, strict=True)) if learnt else {}
        widths = [
            size_of.get(_place(term), np.array([parameter.prior_scale for parameter in term.parameters]))
            for term in terms
        ]
        model = ReadingModel(
            robot=robot,
            p=fit.p,
            free=kinematic.fit.free,
            X_MB=problem.X_MB,
            X_FE=problem.X_FE,
            terms=tuple(terms),
            widths=np.concatenate([kinematic_prior(kinematic.fit), *widths]),
            sigma=fit.sigma,
            later=_later(context),
        )
        present = TermSet.of(robot, context, fit.terms)
        near = linearise(problem, kinematic.fit.free, context, present, fit.p, fit.values)
        asked = TermSet.of(robot, context, tuple(terms)).columns(near.chain, len(fit.sigma))
        columns = np.concatenate([near.kinematics, asked], axis=2)[fit.inlier] / fit.sigma[:, None] * model.widths
        rows = columns.reshape(-1, columns.shape[2])
        return cls(model, rows.T @ rows)


def _place(term: Term) -> tuple:
    return term.effect, term.moves, term.joint, term.constants, tuple(p.name for p in term.parameters)


def _later(context: Context) -> dict[str, float]:
    """When the campaign goes on: at the end of its clock, at the last temperature, with the usual payload."""
    later = {context.clock: float(clock_of(context).max())}
    if context.payload_kg is not None:
        later["payload_kg"] = float(np.median(context.payload_kg))
    if context.temperature_c is not None:
        later["temperature_c"] = float(context.temperature_c[-1])
    return later
