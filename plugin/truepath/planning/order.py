r"""In which order to visit poses: short ways, and nothing of the poses that goes along with time.

A robot that warms up, or a tracker that sinks, adds an error that grows with time. It can be told from an error that
goes with the poses only if time does not: if the correlation of the order with every joint angle, and with every
derivative of the readings, is small. The order is found by simulated annealing (Kirkpatrick 1983) of 2-opt moves on

.. math:: \sum d_{k,k+1} / d_0 + w \sum_j \max(0, |r_j| - r_0)^2 + w \sum \max(0, g_0 - g)^2

d being the ways, :math:`d_0` a short tour, :math:`r_j` the correlations, g the gap between two visits of a pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath.lie import Array

CORRELATION = 0.10  # no more of it costs anything
WEIGHT = 20.0
LEAST_GAP = 1.0 / 3.0  # of the campaign, between two visits of a pose
MOVES_PER_STOP, MOST_MOVES = 1000, 80_000
HOT, COLD = 0.05, 1e-4


@dataclass(frozen=True, eq=False)
class Mixing:
    """How far an order tells time from poses.

    Attributes:
        joints: ``(n,)`` correlation of the order with each joint angle.
        columns: ``(c,)`` with every derivative of the readings by a parameter.
    """

    joints: Array
    columns: Array

    @classmethod
    def of(cls, q_rad: Array, rows: Array) -> Mixing:
        """For poses ``(N, n)`` in their order and the derivatives of their readings ``(N, m, K)``."""
        n = q_rad.shape[1]
        found = standardised(q_rad, rows).T @ _clock(len(q_rad))
        return cls(found[:n], found[n:])

    @property
    def worst(self) -> float:
        """Largest of all, without its sign."""
        return float(np.abs(np.concatenate([self.joints, self.columns])).max(initial=0.0))


def standardised(q_rad: Array, rows: Array) -> Array:
    """``(N, n + m K)`` joints ``(N, n)`` and derivatives ``(N, m, K)``, mean 0 and length 1; what never varies is 0."""
    Z = np.concatenate([q_rad, rows.reshape(len(q_rad), -1)], axis=1)
    size = np.abs(Z).max(axis=0, initial=1e-300)
    Z = Z - Z.mean(axis=0)
    length = np.linalg.norm(Z, axis=0)
    varies = length > 1e-9 * size
    return np.divide(Z, length, out=np.zeros_like(Z), where=varies)


def mixed_order(ways: Array, Z: Array, twins: Array, rng: np.random.Generator) -> Array:
    """``(N,)`` numbers of the stops in the order in which to drive.

    Args:
        ways: ``(N + 1, N + 1)`` length of the way between stops; the last is home, where all begins and ends.
        Z: ``(N, c)`` what time must not go along with, ``standardised``.
        twins: ``(t, 2)`` numbers of stops that visit the same pose.
        rng: of the moves.
    """
    N = len(Z)
    order = _nearest_neighbour(ways, N)
    if N < 4:
        return order
    short = max(_length(ways, order), 1e-9)
    clock, place = _clock(N), np.empty(N, int)
    correlations = Z[order].T @ clock
    one, other = twins.T

    def untold(found: Array, placed: Array) -> float:
        excess = np.maximum(np.abs(found) - CORRELATION, 0.0)
        gap = np.maximum(LEAST_GAP - np.abs(placed[one] - placed[other]) / N, 0.0)
        return WEIGHT * float(excess @ excess + gap @ gap)

    place[order] = np.arange(N)
    length, penalty = 1.0, untold(correlations, place)
    best, least = order.copy(), length + penalty
    moves = min(MOVES_PER_STOP * N, MOST_MOVES)
    heat = HOT * (COLD / HOT) ** (np.arange(1, moves + 1) / moves)
    # By how much a move may make the order worse: what a chance of exp(-worse / heat) comes to, drawn beforehand.
    allowed = heat * rng.exponential(size=moves)
    ends = np.sort(rng.integers(0, N, (moves, 2)), axis=1)
    way, tour = (ways / short).tolist(), [N, *order.tolist(), N]
    for (a, b), most in zip(ends.tolist(), allowed.tolist(), strict=True):
        first, last = tour[a + 1], tour[b + 1]
        from_before, from_after = way[tour[a]], way[tour[b + 2]]
        change = from_before[last] + from_after[first] - from_before[first] - from_after[last]
        if a == b or change - penalty > most:  # too long, even if it were mixed perfectly: most moves end here
            continue
        turned = order[a : b + 1][::-1].copy()
        found = correlations + (clock[a : b + 1] - clock[a : b + 1][::-1]) @ Z[turned]
        placed = place.copy()
        placed[turned] = np.arange(a, b + 1)
        new = untold(found, placed)
        if change + new - penalty <= most:
            order[a : b + 1], tour[a + 1 : b + 2] = turned, turned.tolist()
            correlations, place, length, penalty = found, placed, length + change, new
            if length + penalty < least:
                best, least = order.copy(), length + penalty
    return best


def _clock(count: int) -> Array:
    """``(count,)`` time of equal steps, mean 0 and length 1."""
    steps = np.arange(count) - (count - 1) / 2.0
    return steps / max(float(np.linalg.norm(steps)), 1e-300)


def _length(ways: Array, order: Array) -> float:
    home = len(ways) - 1
    tour = np.concatenate([[home], order, [home]])
    return float(ways[tour[:-1], tour[1:]].sum())


def _nearest_neighbour(ways: Array, count: int) -> Array:
    left, order, here = np.ones(count, bool), [], count
    for _ in range(count):
        here = int(np.argmin(np.where(left, ways[here, :count], np.inf)))
        left[here] = False
        order.append(here)
    return np.array(order, int)
