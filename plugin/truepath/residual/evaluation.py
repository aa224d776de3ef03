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

AT_ONCE = 25  # networks: enough for a thread to do, few enough for the last one to be done soon after the others
MOST_POSES = 1024  # in a block: what they need stays near the processor
LINE_BYTES = 64  # of the cache: a vector register that lies across two of them takes twice as long to load

Item = TypeVar("Item")


def squared_misses(
    genes: Array,
    bias: Array,
    sizes: Array,
    x1: Array,
    target: Array,
    threads: int = 1,
    make: Callable[[int, int], None] | None = None,
) -> Array:
    """``(P,)`` squared misses of P networks, summed over samples and outputs, in the precision of the arguments.

    Args:
        genes, bias, sizes: ``(P, L, d + 1 + k)``, ``(P, k)``, ``(P,)`` as a population has them.
        x1: ``(d + 1, N)`` inputs as ``network.with_ones`` makes them.
        target: ``(k, N)``.
        threads: at most so many; the result does not depend on their number.
        make: writes the genes and biases of the networks from the first number up to the second one into the arrays,
            just before they are needed; None if they are there. Then the arrays must be contiguous.
    """
    from truepath.residual import compiled

    found = np.empty(len(sizes), target.dtype)
    precision: Any = target.dtype.type
    x, wanted = (_in_blocks(values, compiled.LANES) for values in (x1[:-1], target))
    kernel = compiled.misses(len(x1) - 1, len(target), precision)
    genes, bias = np.ascontiguousarray(genes), np.ascontiguousarray(bias)

    def evaluate(start: int) -> None:
        stop = min(start + AT_ONCE, len(sizes))
        if make is not None:
            make(start, stop)
        miss = _aligned((wanted.shape[1],), target.dtype)
        kernel(genes, bias, sizes, x, wanted, target.shape[1], found, start, stop, miss)

    share_out(evaluate, range(0, len(sizes), AT_ONCE), threads)
    return found


def _in_blocks(values: Array, lanes: int) -> Array:
    """``(B, q S)``: rows of ``(q, N)`` cut into pieces of equal size, a multiple of ``lanes``; zeros fill the last."""
    rows, count = values.shape
    blocks = -(-count // MOST_POSES)
    size = lanes * -(-count // (lanes * blocks))
    filled = _aligned((blocks, rows, size), values.dtype)
    filled[-1] = 0.0
    for block, start in enumerate(range(0, count, size)):
        part = values[:, start : start + size]
        filled[block, :, : part.shape[1]] = part
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
