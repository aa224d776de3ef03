r"""Optimal designs: which of many candidates to measure, by exchange (Fedorov 1972; Cook, Nachtsheim 1980).

A candidate is a block of r rows of derivatives, ``(r, K)``, in units of their noise; measuring it adds X^T X to the
information H. Two criteria, both smaller for better designs:

- I: the mean variance of a prediction, tr(H^-1 M), with M the mean of T^T T over the predictions T wanted;
- D: the volume of the confidence region, -log det H.

What a candidate brings follows from a small matrix, with V = H^-1 (Woodbury): S = 1 + X V X^T, the mean variance falls
by tr(S^-1 X V M V X^T), the log determinant rises by log det S. All candidates are looked at together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath.lie import Array

WORTH_IT = 1e-5  # share of the criterion (I), or nats (D), that an exchange must gain
MOST_SWEEPS = 12


@dataclass(frozen=True, eq=False)
class Criterion:
    """What a design shall be good for.

    Attributes:
        wanted: ``(K, K)`` the matrix M for the criterion I; None for D.
    """

    wanted: Array | None = None

    def value(self, H: Array) -> float:
        """Of a design with information ``(K, K)``; the smaller the better."""
        if self.wanted is None:
            return -float(np.linalg.slogdet(H)[1])
        return float(np.trace(np.linalg.solve(H, self.wanted)))

    def gains(self, H: Array, blocks: Array) -> Array:
        """``(k,)`` by how much the value falls with each of the blocks ``(k, r, K)``."""
        k, r, K = blocks.shape
        V = np.linalg.inv(H)
        rows = blocks.reshape(-1, K)
        across = np.swapaxes(blocks, 1, 2)
        S = np.eye(r) + (rows @ V).reshape(k, r, K) @ across
        if self.wanted is None:
            return np.linalg.slogdet(S)[1]
        spread = (rows @ (V @ self.wanted @ V)).reshape(k, r, K) @ across
        return np.trace(np.linalg.solve(S, spread), axis1=1, axis2=2)

    def gain_of(self, before: float) -> float:
        """By how much an exchange must lower a value to be made."""
        return WORTH_IT if self.wanted is None else WORTH_IT * before


def information(blocks: Array) -> Array:
    """``(K, K)`` X^T X of blocks ``(k, r, K)`` together."""
    rows = blocks.reshape(-1, blocks.shape[-1])
    return rows.T @ rows


def greedy(criterion: Criterion, H: Array, blocks: Array, count: int) -> list[int]:
    """Numbers of candidates, each the best one given those before; none twice.

    Args:
        criterion: what for.
        H: ``(K, K)`` information so far, priors included.
        blocks: ``(k, r, K)`` candidates.
        count: how many.
    """
    left, picked = np.ones(len(blocks), bool), []
    for _ in range(min(count, len(blocks))):
        best = int(np.argmax(np.where(left, criterion.gains(H, blocks), -np.inf)))
        picked.append(best)
        left[best] = False
        H = H + information(blocks[best])
    return picked


def exchange(criterion: Criterion, H: Array, blocks: Array, picked: Sequence[int]) -> list[int]:
    """A better choice: each pick in turn gives way to the best candidate in its place, until none does any more.

    Args:
        criterion: what for.
        H: ``(K, K)`` information besides the picks, priors included.
        blocks: ``(k, r, K)`` candidates.
        picked: where to start.
    """
    picked, left = list(picked), np.ones(len(blocks), bool)
    left[picked] = False
    total = H + information(blocks[picked])
    value = criterion.value(total)
    for _ in range(MOST_SWEEPS):
        settled = True
        for place, old in enumerate(picked):
            without = total - information(blocks[old])
            left[old] = True
            gains = np.where(left, criterion.gains(without, blocks), -np.inf)
            new = int(np.argmax(gains))
            if new != old and gains[new] - gains[old] > criterion.gain_of(value):
                picked[place], settled = new, False
                total = without + information(blocks[new])
                value = criterion.value(total)
            left[picked[place]] = False
        if settled:
            break
    return picked
