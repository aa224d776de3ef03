"""What a model leaves of the measurements, as something to learn from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath import lie
from truepath.context import Context
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import CalibratedModel


@dataclass(frozen=True, eq=False)
class Samples:
    """N poses with what a model leaves of them.

    Attributes:
        q_rad: ``(N, n)`` commanded joints.
        miss: ``(N, 3)`` or, with orientations, ``(N, 6)``: measured less predicted position and turn of the probe, m
            and rad, in the real base B.
        visits: ``(N,)`` number of the pose that a row visits, from 0.
    """

    q_rad: Array
    miss: Array
    visits: Array

    @classmethod
    def of(cls, model: CalibratedModel, measurements: Measurements, context: Context | None = None) -> Samples:
        """What ``model`` leaves of measurements, with their circumstances where these are part of a campaign."""
        X_ME = model.predict(Context.of(measurements) if context is None else context)
        miss = measurements.p_ME - X_ME[:, :3, 3]
        R_BM = model.X_MB[:3, :3].T
        parts = [miss @ R_BM.T]
        if measurements.R_ME is not None:
            turn = lie.rotation_vector(measurements.R_ME @ np.swapaxes(X_ME[:, :3, :3], 1, 2))
            parts.append(turn @ R_BM.T)
        return cls(measurements.q_rad, np.concatenate(parts, axis=1), measurements.groups())

    def __len__(self) -> int:
        return len(self.q_rad)

    def subset(self, rows: Array) -> Samples:
        """The poses picked by an index or boolean array."""
        return Samples(self.q_rad[rows], self.miss[rows], np.unique(self.visits[rows], return_inverse=True)[1])

    @property
    def position_mm(self) -> Array:
        """``(N,)`` distance between measured and predicted position."""
        return 1e3 * np.linalg.norm(self.miss[:, :3], axis=1)

    @property
    def orientation_mrad(self) -> Array:
        """``(N,)`` angle between measured and predicted orientation; zero where it was not measured."""
        return 1e3 * np.linalg.norm(self.miss[:, 3:], axis=1)

    @classmethod
    def joined(cls, parts: Sequence[Samples], rows: Sequence[Array], visits: Array) -> Samples:
        """Parts of which each says which rows of the whole it holds; together they hold every row once.

        ``visits`` ``(N,)`` are those of the whole.
        """
        back = np.argsort(np.concatenate(rows))
        q_rad = np.concatenate([part.q_rad for part in parts])[back]
        return cls(q_rad, np.concatenate([part.miss for part in parts])[back], visits)

    def less(self, shift: Array) -> Samples:
        """What is left when a shift and turn ``(N, 6)`` is predicted."""
        return Samples(self.q_rad, self.miss - shift[:, : self.miss.shape[1]], self.visits)
