"""Does a cause predict readings that it was not fitted to? Cross-validation, at random and in blocks of neighbours.

For each part left out the other parts say what the cause does there. If the cause is not real, that prediction has
nothing to do with what the rest of the model leaves there, and the sum of their products is as often negative as
positive. Blocks of poses measured one after the other are left out together as well, because what neighbours have
in common (drift, noise that lasts) would otherwise help to predict them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import special

from truepath.context import Context
from truepath.effect_fit import EffectFit, kinematic_prior, linearise
from truepath.lie import Array
from truepath.robust_fit import RobustFit
from truepath.splits import block_parts, random_parts
from truepath.term_set import TermSet

FOLDS = 5


@dataclass(frozen=True)
class CrossValidation:
    """A model near which everything is linear, in units of the noise.

    Attributes:
        y: ``(N, m)`` readings.
        A: ``(N, m, k)`` columns of kinematics and effects.
        precision: ``(k,)`` of the priors.
        place: ``(k,)`` number of the term that a column belongs to, -1 for the kinematics.
    """

    y: Array
    A: Array
    precision: Array
    place: Array

    @classmethod
    def of(cls, kinematic: RobustFit, context: Context, fit: EffectFit) -> CrossValidation:
        """At a fit, for its inliers."""
        terms = TermSet.of(kinematic.problem.robot, context, fit.terms)
        near = linearise(kinematic.problem, kinematic.free, context, terms, fit.p, fit.values)
        A = np.concatenate([near.kinematics, near.effects], axis=2)[fit.inlier] / fit.sigma[:, None]
        prior = np.concatenate([kinematic_prior(kinematic), fit.prior_size])
        place = np.concatenate([np.full(near.kinematics.shape[2], -1), terms.term])
        return cls(near.y[fit.inlier] / fit.sigma, A, prior**-2.0, place)

    def p_values(self, groups: Mapping[str, Array], visits: Array) -> dict[str, float]:
        """For each set of columns ``(k,)`` True, the larger p value of the two cross-validations.

        Args:
            groups: the sets, by name.
            visits: ``(N,)`` number of the pose that a row visits: visits of one pose are left out together.
        """
        worst = dict.fromkeys(groups, 0.0)
        A, y = self.A.reshape(-1, self.A.shape[2]), self.y.ravel()
        whole = A.T @ A + np.diag(self.precision), A.T @ y
        for folds in (random_parts(visits, FOLDS), block_parts(len(self.y), FOLDS)):
            agreement, spread = dict.fromkeys(groups, 0.0), dict.fromkeys(groups, 0.0)
            for rows in folds:
                for name, (predicted, left) in self._left_out(rows, groups, *whole).items():
                    agreement[name] += float(np.sum(predicted * left))
                    spread[name] += float(np.sum(predicted**2))
            for name in groups:
                # What is left is noise of size 1 if the cause is not real.
                z = agreement[name] / np.sqrt(spread[name]) if spread[name] > 0 else 0.0
                worst[name] = max(worst[name], float(special.ndtr(-z)))
        return worst

    def _left_out(self, rows: Array, groups: Mapping[str, Array], H: Array, g: Array) -> dict[str, tuple[Array, Array]]:
        """By set of columns: its prediction for the rows left out, and what is left there without it."""
        A, y = self.A[rows].reshape(-1, self.A.shape[2]), self.y[rows].ravel()
        H, g = H - A.T @ A, g - A.T @ y
        scale = np.diag(H) ** -0.5
        covariance = scale[:, None] * np.linalg.inv(scale[:, None] * H * scale) * scale
        x = covariance @ g
        out = {}
        for name, own in groups.items():
            # The fit without these columns is the fit under the condition that they are zero.
            own_covariance = covariance[np.ix_(own, own)]
            change = covariance[:, own] @ np.linalg.solve(own_covariance, x[own])
            predicted = A @ change
            left = y - A @ (x - change)
            out[name] = predicted, left
        return out
