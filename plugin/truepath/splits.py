"""Parts of a data set that are left out in turn."""

from __future__ import annotations

import numpy as np

from truepath.lie import Array

BLOCKS_PER_PART = 8


def random_parts(visits: Array, count: int, seed: int = 0) -> list[Array]:
    """Row numbers of ``count`` random parts of nearly equal size; visits ``(N,)`` of one pose stay together."""
    order = np.random.default_rng(seed).permutation(int(visits.max()) + 1)
    part = np.empty(len(order), int)
    part[order] = np.arange(len(order)) % count
    return [np.flatnonzero(part[visits] == number) for number in range(count)]


def block_parts(rows: int, count: int) -> list[Array]:
    """Row numbers of ``count`` parts of some short blocks each, so that a slow drift is seen on both sides of each."""
    block = np.arange(rows) * count * BLOCKS_PER_PART // rows
    return [np.flatnonzero(block % count == number) for number in range(count)]
