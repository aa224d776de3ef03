"""What many networks miss, on the cores of a CPU."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar

import numpy as np

from truepath.lie import Array

AT_ONCE = 20  # networks: enough for a thread to do, few enough for the last one to be done soon after the others
LINE_BYTES = 64  # of the cache: a vector register that lies across two of them takes twice as long to load

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
        miss = _aligned((wanted.shape[1],), target.dtype)
        kernel(genes, bias, sizes, x, wanted, target.shape[1], found, start, stop, miss)

    share_out(evaluate, range(0, len(sizes), AT_ONCE), threads)
    return found


def _in_blocks(values: Array, size: int) -> Array:
    """``(B, q size)``: rows of ``(q, N)`` cut into pieces of that size; the last is filled up with zeros."""
    rows, count = values.shape
    blocks = -(-count // size)
    filled = _aligned((blocks, rows, size), values.dtype)
    whole, left = divmod(count, size)
    filled[:whole] = values[:, : whole * size].reshape(rows, whole, size).swapaxes(0, 1)
    if left:
        filled[-1, :, :left], filled[-1, :, left:] = values[:, whole * size :], 0.0
    return filled.reshape(blocks, -1)


def _aligned(shape: tuple[int, ...], dtype: Any) -> Array:
    """An array without content that begins where a line of the cache does."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    room = np.empty(size + LINE_BYTES, np.uint8)
    start = -room.ctypes.data % LINE_BYTES
    return room[start : start + size].view(dtype).reshape(shape)


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
