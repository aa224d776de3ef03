"""What many networks miss, computed by numpy on the cores of a CPU.

numpy's tanh in single precision takes less time than torch's logistic function, and its products of small matrices
less than torch's, so this is twice as fast. The logistic function of eq. 13 is (1 + tanh(z / 2)) / 2; the halves are
multiplied into the weights, which are few.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

import numpy as np
from threadpoolctl import ThreadpoolController

from truepath.lie import Array

Item = TypeVar("Item")


def squared_misses(genes: Array, bias: Array, x1: Array, target: Array) -> Array:
    """``(P,)`` squared misses of P networks, summed over samples and outputs, in the precision of the arguments.

    Args:
        genes: ``(P, L, d + 1 + k)`` per neuron its input weights, its threshold, its output weights.
        bias: ``(P, k)``.
        x1: ``(d + 1, N)`` inputs as ``network.with_ones`` makes them.
        target: ``(k, N)``.
    """
    half = genes.dtype.type(0.5)
    hidden = half * genes[..., : len(x1)]
    output = half * genes[..., len(x1) :].swapaxes(1, 2)
    said = np.matmul(hidden, x1)
    np.tanh(said, out=said)
    miss = np.matmul(output, said)
    miss += (bias + output.sum(axis=2))[:, :, None]
    miss -= target
    return np.einsum("pkn,pkn->p", miss, miss)


def share_out(work: Callable[[Item], None], items: Sequence[Item], threads: int) -> None:
    """Calls ``work`` with each item, on so many threads; the calling one is the first of them.

    An item goes to whoever is free, so that a core which others use holds nobody up. numpy's products are kept to the
    thread that asks for them; as this belongs to the process, who shares out from several threads at the same time
    should keep them so all the while.
    """
    waiting = iter(tuple(items))

    def drain() -> None:
        for item in waiting:
            work(item)

    with _blas().limit(limits=1):
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


@cache
def _blas() -> ThreadpoolController:
    return ThreadpoolController().select(user_api="blas")
