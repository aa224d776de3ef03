"""What is left when everything named is in the model: how much of it is noise, and whether it has a pattern."""

from __future__ import annotations

import numpy as np
from scipy import stats
from scipy.spatial import cKDTree

from truepath.lie import Array
from truepath.measurements import Measurements

MEAN_OF_A_POINT = 2.0 * np.sqrt(2.0 / np.pi)  # mean length of a vector of three standard normal numbers
FEWEST_REPEATS = 5
NEAREST_SHARE = 0.25  # of the pairs of neighbours, the closest ones
NEIGHBOURS = 3


def noise_floor_mm(measurements: Measurements, residual: Array) -> tuple[float, str]:
    """Mean position error that noise alone makes, and where that is known from: ``repeats`` or ``neighbours``.

    Args:
        measurements: N poses.
        residual: ``(N, m)`` of the best model, m.
    """
    groups = _visits(measurements)
    count = np.bincount(groups)
    repeats = int(np.sum(count - 1))
    if repeats >= FEWEST_REPEATS:
        mean = np.stack([np.bincount(groups, residual[:, axis]) / count for axis in range(3)], axis=1)
        squares = float(np.sum((residual[:, :3] - mean[groups]) ** 2)) / (3 * repeats)
        return float(1e3 * MEAN_OF_A_POINT * np.sqrt(squares)), "repeats"
    scaled = _spread(measurements.q_rad)
    distance, neighbour = cKDTree(scaled).query(scaled, k=2)
    near = np.argsort(distance[:, 1])[: max(int(NEAREST_SHARE * len(distance)), 10)]
    difference = residual[near, :3] - residual[neighbour[near, 1], :3]
    sigma = float(np.sqrt(np.mean(difference**2) / 2.0))
    return float(1e3 * MEAN_OF_A_POINT * sigma), "neighbours"


def alike_by_chance(measurements: Measurements, residual: Array, sigma: Array) -> float:
    """Probability that residuals ``(N, m)`` without a pattern are so much like those of their neighbours.

    Neighbours in the joint angles, and neighbours in the order of measurement; the smaller of the two
    probabilities, doubled.
    """
    whitened = residual / sigma
    # Few large residuals must not decide.
    length = np.linalg.norm(whitened, axis=1, keepdims=True)
    whitened = whitened * np.minimum(1.0, 3.0 * np.sqrt(whitened.shape[1]) / np.maximum(length, 1e-12))
    N = len(whitened)
    scaled = _spread(measurements.q_rad)
    near = cKDTree(scaled).query(scaled, k=min(NEIGHBOURS + 1, N))[1]
    pairs = np.unique(np.sort(np.stack([np.repeat(near[:, 0], near.shape[1] - 1), near[:, 1:].ravel()], 1), 1), axis=0)
    order = np.stack([np.arange(N - 1), np.arange(1, N)], axis=1)
    return min(1.0, 2.0 * min(_correlated(whitened, each) for each in (pairs[pairs[:, 0] != pairs[:, 1]], order)))


def _correlated(whitened: Array, pairs: Array) -> float:
    products = np.sum(whitened[pairs[:, 0]] * whitened[pairs[:, 1]], axis=1)
    variance = np.mean(whitened**2, axis=0)
    return float(stats.norm.sf(products.sum() / np.sqrt(len(pairs) * np.sum(variance**2))))


def _spread(q_rad: Array) -> Array:
    """Joints in units of their spread; a joint that hardly moved counts little."""
    return q_rad / np.maximum(q_rad.std(axis=0), np.radians(1.0))


def _visits(measurements: Measurements) -> Array:
    if measurements.pose_id is not None:
        return measurements.groups()
    return np.unique(np.round(measurements.q_rad, 7), axis=0, return_inverse=True)[1].ravel()
