"""Which parameters the data can see."""

from __future__ import annotations

import numpy as np

from truepath.lie import Array

REDUNDANT = 1e-6


def independent_columns(jacobian: Array, rank: Array) -> Array:
    """``(k,)`` True for parameters whose effect is no combination of the effects of the others that are kept.

    Gram-Schmidt in a stated order, so that it is the analyst and not the rounding who decides which one of a
    redundant set is held; among equals the one with the most effect of its own comes first. A column counts as
    dependent when less than 1e-6 of its length is its own.

    Args:
        jacobian: ``(rows, k)`` or ``(N, m, k)``, any rows.
        rank: ``(k,)`` numbers; columns with a lower one are kept first.
    """
    J = jacobian.reshape(-1, jacobian.shape[-1])
    length = np.linalg.norm(J, axis=0)
    seen = length > 1e-12 * length.max(initial=0.0)
    left = np.divide(J, length, out=np.zeros_like(J), where=seen)
    independent = np.zeros(J.shape[1], bool)
    for level in np.unique(rank):
        candidates = np.flatnonzero((rank == level) & seen)
        while len(candidates):
            own = np.linalg.norm(left[:, candidates], axis=0)
            best = candidates[int(np.argmax(own))]
            if own.max() <= REDUNDANT:
                break
            independent[best] = True
            direction = left[:, best] / own.max()
            for _ in range(2):  # twice is enough (Giraud, Langou 2005)
                left -= np.outer(direction, direction @ left)
            candidates = candidates[candidates != best]
    return independent
