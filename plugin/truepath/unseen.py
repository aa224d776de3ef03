"""Models fitted to the poses that were looked at, judged on those that were not."""

from __future__ import annotations

import numpy as np

from truepath import lie
from truepath.calibrate import KinematicFit, finish
from truepath.context import Context
from truepath.effect_fit import fit_effects
from truepath.effects.base import Term
from truepath.findings import Evidence
from truepath.kept_away import KeptAway
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import CalibratedModel
from truepath.motions import ChainPoses, Moves

GROSS = 10.0  # times the median miss: no model is to blame for such a reading
LEAST_LEVER_M = 0.03


class UnseenPoses(KeptAway):
    """Models fitted to the poses that were looked at, on those that were not.

    A gross error is left out, if it is one with and without the findings: none is left out because one of both fails
    on it.

    Attributes:
        kinematic, final: without and with the findings.
    """

    def __init__(
        self, fit: KinematicFit, evidence: Evidence, measurements: Measurements, context: Context, unseen: Array
    ) -> None:
        self.fit, self.evidence, self.context = fit, evidence, context
        self.kinematic, self.final = self.model(()), finish(fit, evidence.fit).model
        sane = np.zeros(len(measurements), bool)
        for model in (self.kinematic, self.final):
            miss = np.linalg.norm(model.predict(context)[:, :3, 3] - measurements.p_ME, axis=1)
            sane |= miss <= GROSS * np.median(miss)
        super().__init__(measurements, context, unseen=unseen & sane, seen=sane & ~unseen)

    def model(self, terms: tuple[Term, ...]) -> CalibratedModel:
        """The kinematics with some of the findings' terms."""
        found = fit_effects(self.fit.fit, self.fit.context, terms, prune=False, start=self.evidence.fit)
        return finish(self.fit, found).model

    def predict(self, model: str) -> Array:
        """``(N, 4, 4)`` by ``nominal``, ``kinematic`` or ``final``, for all poses."""
        if model == "nominal":
            return self.final.predict_nominal(self.context)
        chosen: CalibratedModel = getattr(self, model)
        return chosen.predict(self.context)

    def residual(self, model: str) -> Array:
        """``(N, m)`` predicted less measured, in M."""
        X_ME = self.predict(model)
        residual = X_ME[:, :3, 3] - self.measurements.p_ME
        if self.measurements.R_ME is None:
            return residual
        turn = lie.rotation_vector(X_ME[:, :3, :3] @ np.swapaxes(self.measurements.R_ME, 1, 2))
        return np.concatenate([residual, turn], axis=1)

    def joint_view(self, model: str) -> Array:
        """``(N, n)`` turn of each joint alone that would explain the residual of a pose best, rad."""
        final, residual = self.final, self.residual(model)[:, :3]
        phi = final.true_joints(self.context)
        chain = ChainPoses.of(final.robot, final.p, phi, final.X_MB, final.X_FE)
        view = np.full(phi.shape, np.nan)
        for joint in range(1, phi.shape[1] + 1):
            moved = chain.displacement(Moves.JOINT, joint)[:, :3, 0]
            lever2 = np.sum(moved**2, axis=1)
            seen = lever2 > LEAST_LEVER_M**2
            view[seen, joint - 1] = -np.sum(moved * residual, axis=1)[seen] / lever2[seen]
        return view
