r"""Optimal designs: which of many candidates to measure, by exchange (Fedorov 1972; Cook, Nachtsheim 1980).

A candidate is a block of r rows of derivatives, ``(r, K)``, in units of their noise; measuring it adds X^T X to the
information H. Two criteria, both smaller for better designs:

- I: the mean variance of a prediction, tr(H^-1 M), with M the mean of T^T T over the predictions T wanted;
- D: the volume of the confidence region, -log det H.

What a candidate brings follows from a small matrix, with V = H^-1 (Woodbury): S = 1 + X V X^T, the mean variance falls
by tr(S^-1 X V M V X^T), the log determinant rises by log det S. All candidates are looked at together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from truepath.lie import Array

WORTH_IT = 1e-5  # share of the criterion (I), or nats (D), that an exchange must gain
MOST_SWEEPS = 12

Usable = Callable[[int], bool]


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

    def most(self, H: Array, blocks: Array) -> Array:
        """``(k,)`` what the gains cannot exceed, S being at least 1; a fifth of the work."""
        V = np.linalg.inv(H)
        rows = blocks.reshape(-1, blocks.shape[2])
        reach = rows @ (V if self.wanted is None else V @ self.wanted @ V)
        return np.einsum("ij,ij->i", reach, rows).reshape(len(blocks), -1).sum(axis=1)

    def gain_of(self, before: float) -> float:
        """By how much an exchange must lower a value to be made."""
        return WORTH_IT if self.wanted is None else WORTH_IT * before


def information(blocks: Array) -> Array:
    """``(K, K)`` X^T X of blocks ``(k, r, K)`` together."""
    rows = blocks.reshape(-1, blocks.shape[-1])
    return rows.T @ rows


def greedy(criterion: Criterion, H: Array, blocks: Array, count: int, usable: Usable = lambda _: True) -> list[int]:
    """Numbers of candidates, each the best one given those before; none twice. Fewer where no more are usable.

    Args:
        criterion: what for.
        H: ``(K, K)`` information so far, priors included.
        blocks: ``(k, r, K)`` candidates.
        count: how many.
        usable: whether a candidate can be taken after all; asked only of those that would be.
    """
    left, picked = np.ones(len(blocks), bool), []
    for _ in range(min(count, len(blocks))):
        order = np.argsort(-criterion.gains(H, blocks), kind="stable")
        best = _first_usable(order[left[order]], left, usable)
        if best is None:
            break
        picked.append(best)
        left[best] = False
        H = H + information(blocks[best])
    return picked


def _first_usable(order: Array, left: Array, usable: Usable) -> int | None:
    """The first usable of candidates in this order; those before it are no longer ``left``."""
    for k in order.tolist():
        if usable(k):
            return k
        left[k] = False
    return None


def exchange(
    criterion: Criterion, H: Array, blocks: Array, picked: Sequence[int], usable: Usable = lambda _: True
) -> list[int]:
    """A better choice: each pick in turn gives way to the best candidate in its place, until none does any more.

    Args:
        criterion: what for.
        H: ``(K, K)`` information besides the picks, priors included.
        blocks: ``(k, r, K)`` candidates.
        picked: where to start.
        usable: as for ``greedy``.
    """
    picked, left = list(picked), np.ones(len(blocks), bool)
    left[picked] = False
    total = H + information(blocks[picked])
    value = criterion.value(total)
    for _ in range(MOST_SWEEPS):
        settled = True
        for place, old in enumerate(picked):
            without = total - information(blocks[old])
            least = criterion.gains(without, blocks[old : old + 1])[0] + criterion.gain_of(value)
            promising = np.flatnonzero(left & (criterion.most(without, blocks) > least))
            gains = criterion.gains(without, blocks[promising])
            order = np.argsort(-gains, kind="stable")
            new = _first_usable(promising[order[gains[order] > least]], left, usable)
            if new is not None:
                picked[place], settled = new, False
                left[old], left[new] = True, False
                total = without + information(blocks[new])
                value = criterion.value(total)
        if settled:
            break
    return picked
