"""Poses that were kept away from a fit, and how well models do there; repeated visits of a pose count as one."""

from __future__ import annotations

import numpy as np
from scipy import special

from truepath.barycentre import barycentres
from truepath.context import Context
from truepath.diagnosis import Gain
from truepath.iso9283 import Accuracy, accuracy
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import CalibratedModel


class KeptAway:
    """Measured poses, some of which no fit and no choice has seen.

    Attributes:
        measurements, context: all poses, and their circumstances.
        unseen: ``(N,)`` True for poses to judge by.
        seen: ``(N,)`` True for poses to learn from.
    """

    def __init__(self, measurements: Measurements, context: Context, unseen: Array, seen: Array | None = None) -> None:
        self.measurements, self.context, self.unseen = measurements, context, unseen
        self.seen = ~unseen if seen is None else seen

    def accuracy(self, model: CalibratedModel) -> Accuracy:
        """On the unseen poses."""
        return self._accuracy(model.predict(self.context.subset(self.unseen)))

    def nominal_accuracy(self, model: CalibratedModel) -> Accuracy:
        """That of the nominal robot."""
        return self._accuracy(model.predict_nominal(self.context.subset(self.unseen)))

    def errors_mm(self, model: CalibratedModel) -> Array:
        """``(k,)`` of the k unseen poses, each at the barycentre of its visits."""
        part = self.measurements.subset(self.unseen)
        error = model.predict(self.context.subset(self.unseen))[:, :3, 3] - part.p_ME
        return 1e3 * np.linalg.norm(barycentres(error, part.groups()), axis=1)

    def mean(self, model: CalibratedModel) -> float:
        """Mean error on the unseen poses, mm: that of ``accuracy``."""
        return float(self.errors_mm(model).mean())

    def gain(self, without: CalibratedModel, model: CalibratedModel) -> Gain:
        """Of a model over another, with Student's interval of the paired difference: k poses, however often visited."""
        before, after = self.errors_mm(without), self.errors_mm(model)
        difference = before - after
        mean, k = float(difference.mean()), len(difference)
        half = float(special.stdtrit(k - 1, 0.975) * difference.std(ddof=1) / np.sqrt(k)) if k > 1 else np.inf
        return Gain(float(before.mean()), float(after.mean()), (mean - half, mean + half))

    def _accuracy(self, X_ME: Array) -> Accuracy:
        part = self.measurements.subset(self.unseen)
        return accuracy(X_ME, part.p_ME, part.R_ME, part.groups())
