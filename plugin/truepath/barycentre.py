"""Repeated visits of one pose: they are no independent witnesses, so their barycentre counts once (ISO 9283:1998)."""

from __future__ import annotations

import numpy as np

from truepath.lie import Array


def barycentres(values: Array, groups: Array) -> Array:
    """``(G, k)`` means of the values ``(N, k)`` of each group.

    Args:
        values: readings, or errors of readings.
        groups: ``(N,)`` any numbers, equal for visits of one pose; the G poses come in their order.
    """
    _, group, visits = np.unique(groups, return_inverse=True, return_counts=True)
    total = np.stack([np.bincount(group, values[:, k]) for k in range(values.shape[1])], axis=1)
    return total / visits[:, None]


def pose_count(groups: Array) -> int:
    """How many different poses ``(N,)`` rows visit."""
    return len(np.unique(groups))
