"""What many networks miss, on the cores of a CPU."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

import numpy as np

from truepath.lie import Array

AT_ONCE = 25  # networks: enough for a thread to do, few enough for the last one to be done soon after the others
MOST_POSES = 1024  # in a block: what they need stays near the processor

Item = TypeVar("Item")


@dataclass(frozen=True, eq=False)
class Blocks:
    """Samples as the kernels take them: a row per block of poses, so many that what they need stays near the processor.

    Attributes:
        x, target: ``(B, d S)``, ``(B, k S)``; zeros fill the last block.
        poses: how many there are.
        inputs, outputs: d and k.
    """

    x: Array
    target: Array
    poses: int
    inputs: int
    outputs: int

    @classmethod
    def of(cls, x1: Array, target: Array) -> Blocks:
        """From ``(d + 1, N)`` inputs as ``network.with_ones`` makes them, and ``(k, N)`` targets."""
        return cls(_in_blocks(x1[:-1]), _in_blocks(target), target.shape[1], len(x1) - 1, len(target))


def squared_misses(genes: Array, bias: Array, sizes: Array, x1: Array, target: Array, threads: int = 1) -> Array:
    """``(P,)`` squared misses of P networks, summed over samples and outputs, in the precision of the arguments.

    Args:
        genes, bias, sizes: ``(P, L, d + 1 + k)``, ``(P, k)``, ``(P,)`` as a population has them.
        x1: ``(d + 1, N)`` inputs as ``network.with_ones`` makes them.
        target: ``(k, N)``.
        threads: at most so many; the result does not depend on their number.
    """
    from truepath.residual import compiled

    found, blocks = np.empty(len(sizes), target.dtype), Blocks.of(x1, target)
    precision: Any = target.dtype.type
    kernel = compiled.misses(blocks.inputs, blocks.outputs, precision)
    genes, bias = np.ascontiguousarray(genes), np.ascontiguousarray(bias)

    def evaluate(start: int, stop: int) -> None:
        kernel(genes, bias, sizes, blocks.x, blocks.target, blocks.poses, found, start, stop)

    a_few_at_a_time(evaluate, len(sizes), threads)
    return found


def _in_blocks(values: Array) -> Array:
    """``(B, q S)``: rows of ``(q, N)`` cut into pieces of equal size, a multiple of a register's; zeros at the end."""
    from truepath.residual import compiled

    rows, count = values.shape
    blocks = -(-count // MOST_POSES)
    size = compiled.LANES * -(-count // (compiled.LANES * blocks))
    filled = compiled.aligned(blocks * rows * size, values.dtype).reshape(blocks, rows, size)
    filled[-1] = 0.0
    for block, start in enumerate(range(0, count, size)):
        part = values[:, start : start + size]
        filled[block, :, : part.shape[1]] = part
    return filled.reshape(blocks, -1)


def a_few_at_a_time(work: Callable[[int, int], None], count: int, threads: int) -> None:
    """Calls ``work`` with a first number and the one after the last, until all networks had their turn."""
    share_out(lambda start: work(start, min(start + AT_ONCE, count)), range(0, count, AT_ONCE), threads)


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
