"""What is left when everything named is in the model: how much of it is noise, and whether it has a pattern."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy import special
from scipy.spatial import cKDTree

from truepath.lie import Array
from truepath.measurements import Measurements

MEAN_OF_A_POINT = 2.0 * np.sqrt(2.0 / np.pi)  # mean length of a vector of three standard normal numbers
FEWEST_REPEATS = 5
NEAREST_SHARE = 0.25  # of the pairs of neighbours, the closest ones
NEIGHBOURS = 3
MOST_SIGMAS = 6.0


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
    scaled = spread(measurements.q_rad)
    distance, neighbour = cKDTree(scaled).query(scaled, k=2)
    near = np.argsort(distance[:, 1])[: max(int(NEAREST_SHARE * len(distance)), 10)]
    difference = residual[near, :3] - residual[neighbour[near, 1], :3]
    sigma = float(np.sqrt(np.mean(difference**2) / 2.0))
    return float(1e3 * MEAN_OF_A_POINT * sigma), "neighbours"


def alike_by_chance(residual: Array, sigma: Array, spaces: Iterable[Array], views: Iterable[Array]) -> float:
    """Probability that residuals without a pattern are anywhere so much like those of their neighbours.

    A pattern makes residuals alike where poses are alike in what it depends on, seen in the axes in which it acts.
    Nobody knows either, so many are tried, and the smallest probability is multiplied by their number.

    Args:
        residual: ``(N, m)``.
        sigma: ``(m,)`` noise.
        spaces: what poses may be alike in, each ``(N, d)``, in comparable units.
        views: axes to see positions in, each ``(N, 3, k)``: unit vectors in the measurement frame.
    """
    position = residual[:, :3] / sigma[:3]
    # Few large residuals must not decide.
    length = np.linalg.norm(position, axis=1, keepdims=True)
    position = position * np.minimum(1.0, MOST_SIGMAS / np.maximum(length, 1e-12))
    seen = [position, *(np.einsum("kc,kcj->kj", position, view) for view in views)]
    pairs = [_pairs(space) for space in spaces]
    p = [_correlated(each, near) for each in seen for near in pairs]
    return min(1.0, len(p) * min(p))


def more_than_repeats(measurements: Measurements, residual: Array) -> float:
    """Probability that residuals ``(N, m)`` of averaged visits are so much larger than their repeats allow: F test.

    1 where too few poses were visited again.
    """
    groups = _visits(measurements)
    count = np.bincount(groups)
    within = int(np.sum(count - 1))
    if within < FEWEST_REPEATS:
        return 1.0
    mean = np.stack([np.bincount(groups, residual[:, axis]) / count for axis in range(3)], axis=1)
    noise = float(np.sum((residual[:, :3] - mean[groups]) ** 2)) / (3 * within)
    between = float(np.sum(count[:, None] * mean**2)) / (3 * len(count))
    return float(special.fdtrc(3 * len(count), 3 * within, between / noise))


def _pairs(space: Array) -> Array:
    """``(k, 2)`` rows that are neighbours."""
    near = cKDTree(space).query(space, k=min(NEIGHBOURS + 1, len(space)))[1]
    pairs = np.stack([np.repeat(np.arange(len(space)), near.shape[1]), near.ravel()], axis=1)
    return np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)


def _correlated(whitened: Array, pairs: Array) -> float:
    products = np.sum(whitened[pairs[:, 0]] * whitened[pairs[:, 1]], axis=1)
    variance = np.mean(whitened**2, axis=0)
    return float(special.ndtr(-products.sum() / np.sqrt(len(pairs) * np.sum(variance**2))))


def spread(q_rad: Array) -> Array:
    """Joints in units of their spread; a joint that hardly moved counts little."""
    return q_rad / np.maximum(q_rad.std(axis=0), np.radians(1.0))


def _visits(measurements: Measurements) -> Array:
    if measurements.pose_id is not None:
        return measurements.groups()
    return np.unique(np.round(measurements.q_rad, 7), axis=0, return_inverse=True)[1].ravel()
