"""Positioning and distance accuracy after ISO 9283:1998 (Jiang et al. 2020, eq. 23 to 28), and orientation."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from truepath import lie
from truepath.barycentre import barycentres
from truepath.lie import Array

MAX_PAIRS = 500_000


@dataclass(frozen=True)
class ErrorStatistics:
    """Mean, root mean square, 95th percentile and maximum of errors that are not negative."""

    mean: float
    rms: float
    p95: float
    max: float

    @classmethod
    def of(cls, errors: Array) -> ErrorStatistics:
        """Raises ValueError for an empty array."""
        if errors.size == 0:
            raise ValueError("no errors to summarise")
        return cls(
            float(errors.mean()),
            float(np.sqrt(np.mean(errors**2))),
            float(np.quantile(errors, 0.95)),
            float(errors.max()),
        )


@dataclass(frozen=True)
class Accuracy:
    """Accuracy of a set of poses; distance is None for a single pose, orientation where it was not measured."""

    position_mm: ErrorStatistics
    distance_mm: ErrorStatistics | None
    orientation_mrad: ErrorStatistics | None

    def to_dict(self) -> dict:
        return asdict(self)


def accuracy(X_predicted: Array, p_measured: Array, R_measured: Array | None, groups: Array) -> Accuracy:
    """Compares what a model says with what was measured.

    Args:
        X_predicted: ``(N, 4, 4)`` probe poses that the model gives for the commanded joints.
        p_measured: ``(N, 3)`` measured positions, m.
        R_measured: ``(N, 3, 3)`` measured orientations or None.
        groups: ``(N,)`` group of each row, from 0; rows of one group are visits of one pose and are
            replaced by their barycentre.
    """
    attained, commanded = barycentres(p_measured, groups), barycentres(X_predicted[:, :3, 3], groups)
    position = np.linalg.norm(attained - commanded, axis=1)
    first, second = _pairs(len(attained))
    distance = np.abs(
        np.linalg.norm(attained[first] - attained[second], axis=1)
        - np.linalg.norm(commanded[first] - commanded[second], axis=1)
    )
    orientation = None
    if R_measured is not None:
        turn = R_measured @ np.swapaxes(X_predicted[:, :3, :3], 1, 2)
        # The mean of small rotation vectors is the mean rotation to second order.
        mean_turn = barycentres(lie.rotation_vector(turn), groups)
        orientation = ErrorStatistics.of(np.linalg.norm(mean_turn, axis=1) * 1e3)
    return Accuracy(
        ErrorStatistics.of(position * 1e3),
        ErrorStatistics.of(distance * 1e3) if len(distance) else None,
        orientation,
    )


def _pairs(count: int) -> tuple[Array, Array]:
    """All pairs of poses, or half a million drawn with a fixed seed where there are more."""
    if count * (count - 1) // 2 <= MAX_PAIRS:
        return np.triu_indices(count, 1)
    rng = np.random.default_rng(0)
    first = rng.integers(0, count, MAX_PAIRS)
    return first, (first + rng.integers(1, count, MAX_PAIRS)) % count
