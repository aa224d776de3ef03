"""Which parameters the data can see."""

from __future__ import annotations

import numpy as np

from truepath.lie import Array

REDUNDANT = 1e-6


def independent_columns(jacobian: Array, order: Array) -> Array:
    """``(k,)`` True for parameters whose effect is no combination of the effects of those before them.

    Rank by Gram-Schmidt in a stated order, so that it is the analyst and not the rounding who decides which
    one of a redundant set is held. A column counts as dependent when less than 1e-6 of its length is its own.

    Args:
        jacobian: ``(rows, k)`` or ``(N, m, k)``, any rows.
        order: ``(k,)`` column numbers, the ones to keep first.
    """
    J = jacobian.reshape(-1, jacobian.shape[-1])
    length = np.linalg.norm(J, axis=0)
    independent = np.zeros(J.shape[1], bool)
    seen = length > 1e-12 * length.max(initial=0.0)
    basis = np.zeros((J.shape[0], 0))
    for c in (c for c in order if seen[c]):
        v = J[:, c] / length[c]
        for _ in range(2):  # twice is enough (Giraud, Langou 2005)
            v = v - basis @ (basis.T @ v)
        own = np.linalg.norm(v)
        if own > REDUNDANT:
            independent[c] = True
            basis = np.column_stack([basis, v / own])
    return independent
