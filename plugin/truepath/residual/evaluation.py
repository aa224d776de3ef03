"""What many networks miss, on the cores of a CPU."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar

import numpy as np

from truepath.lie import Array

AT_ONCE = 8  # networks: enough for a thread to do, few enough for the last one to be done soon after the others

Item = TypeVar("Item")


def squared_misses(genes: Array, bias: Array, sizes: Array, x1: Array, target: Array, threads: int = 1) -> Array:
    """``(P,)`` squared misses of P networks, summed over samples and outputs, in the precision of the arguments.

    Args:
        genes, bias, sizes: ``(P, L, d + 1 + k)``, ``(P, k)``, ``(P,)`` as a population has them.
        x1: ``(d + 1, N)`` inputs as ``network.with_ones`` makes them.
        target: ``(k, N)``.
        threads: at most so many; the result does not depend on their number.
    """
    from truepath.residual import compiled

    found = np.empty(len(sizes), target.dtype)
    precision: Any = target.dtype.type
    x, wanted = (_in_blocks(values, compiled.BLOCK) for values in (x1[:-1], target))
    kernel = compiled.misses(len(x1) - 1, len(target), precision)
    genes, bias = np.ascontiguousarray(genes), np.ascontiguousarray(bias)

    def evaluate(start: int) -> None:
        stop = min(start + AT_ONCE, len(sizes))
        kernel(genes, bias, sizes, x, wanted, target.shape[1], found, start, stop)

    share_out(evaluate, range(0, len(sizes), AT_ONCE), threads)
    return found


def _in_blocks(values: Array, size: int) -> Array:
    """``(B, q size)``: rows of ``(q, N)`` cut into pieces of that size; the last is filled up with zeros."""
    blocks = -(-values.shape[1] // size)
    filled = np.pad(values, ((0, 0), (0, blocks * size - values.shape[1])))
    return filled.reshape(len(values), blocks, size).swapaxes(0, 1).reshape(blocks, -1)


def share_out(work: Callable[[Item], None], items: Sequence[Item], threads: int) -> None:
    """Calls ``work`` with each item, on so many threads; the calling one is the first of them.

    An item goes to whoever is free, so that a core which others use holds nobody up.
    """
    waiting = iter(tuple(items))

    def drain() -> None:
        for item in waiting:
            work(item)

    helpers = [_helpers().submit(drain) for _ in range(min(threads, len(items)) - 1)]
    try:
        drain()
    finally:
        for helper in helpers:
            if not helper.cancel():  # one that has not begun has nothing left to do
                helper.result()


@cache
def _helpers() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count(), thread_name_prefix="evaluation")
