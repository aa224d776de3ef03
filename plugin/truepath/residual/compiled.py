"""The inner loops of an evolution on a CPU, compiled when they are first used.

A network's activations never reach memory: its weights stay in registers while the poses go by, as many at a time as
a vector register holds. numpy and torch write each intermediate result out and read it again.

The compiler unrolls the loops over inputs and outputs, so there is a kernel for each number of them. What it has
compiled it keeps beside this file, or where numba keeps such things for the user.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from typing import Any

import numpy as np
from numba import njit
from numba.np.unsafe.ndarray import to_fixed_tuple

LANES = 16  # numbers in single precision in the widest vector register, and in a line of the cache

# tanh(w) is about SCALE w P(w^2) / Q(w^2) for |w| <= LIMIT; P and Q from their constants up, the highest is 1.
LIMIT = np.float32(7.0)
SCALE = 0.0276079499
P0, P1, P2 = (np.float32(value) for value in (254450.617, 31303.1186, 579.384042))
Q0, Q1, Q2 = (np.float32(value) for value in (7024.89019, 3205.74068, 148.029788))

FAST = {"contract", "nnan", "nsz"}  # fused products, and the processor's own minimum: weights are always numbers

Kernel = Callable[..., None]


def compiled(function: Callable[..., Any], **options: Any) -> Any:
    """The function as machine code that leaves other Python threads alone; kept on disk where that is possible."""
    options |= {"nogil": True, "error_model": "numpy"}
    try:
        kernel: Any = njit(function, cache=True, **options)
    except RuntimeError:  # there is no folder that can be written
        return njit(function, **options)
    kernel._cache = _Forgiving(kernel._cache)
    return kernel


class _Forgiving:
    """What numba keeps on disk, when it can be read and written; it is no reason to fail if it cannot."""

    def __init__(self, kept: Any) -> None:
        self._kept = kept

    def load_overload(self, *what: Any) -> Any:
        try:
            return self._kept.load_overload(*what)
        except Exception:  # spoilt files raise whatever their bytes mean
            with suppress(Exception):
                self._kept.flush()  # begins anew
            return None

    def save_overload(self, *what: Any) -> None:
        with suppress(Exception):
            self._kept.save_overload(*what)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._kept, name)


@partial(compiled, inline="always", fastmath=FAST)
def _tanh_over_scale(w):  # type: ignore[no-untyped-def]
    """``tanh(w) / SCALE`` in single precision, without a branch, so that 16 of them go through a vector register.

    The logistic function ``(1 + tanh(z / 2)) / 2`` made of it is wrong by 7e-7 at most, rounding included: ten units
    in the last place of numbers just below 1. The rational function has the least largest error of its degrees on
    0 to LIMIT, found by Lawson's weighted least squares (9e-7 in tanh); beyond, 1 is as near to tanh.
    """
    w = min(max(w, -LIMIT), LIMIT)
    square = w * w
    above = ((square + P2) * square + P1) * square + P0
    below = ((square + Q2) * square + Q1) * square + Q0
    return w * above / below


@partial(compiled, fastmath=FAST | {"reassoc"})  # so that lanes are summed on their own
def _sum_of_squares(values, start, stop):  # type: ignore[no-untyped-def]
    total = values.dtype.type(0.0)
    for n in range(start, stop):
        total += values[n] * values[n]
    return total


@compiled
def aligned(length, precision):  # type: ignore[no-untyped-def]
    """An array without content that begins where a line of the cache does: a register's load touches only one."""
    room = np.empty(length + LANES, precision)
    start = -(room.ctypes.data // room.itemsize) % LANES
    return room[start : start + length]


@cache
def misses(inputs: int, outputs: int, precision: Any) -> Kernel:
    """The kernel ``(genes, bias, sizes, x, target, poses, found, start, stop)`` for networks of d inputs.

    It writes into ``found[start:stop]`` the squared misses of these networks, summed over poses and outputs.

    Args of the kernel:
        genes, bias, sizes: ``(P, L, d + 1 + k)``, ``(P, k)``, ``(P,)`` as a population has them.
        x, target: ``(B, d S)``, ``(B, k S)``: a row per block of S poses, each quantity's numbers together. S is
            divisible by LANES, and small enough for the fastest cache.
        poses: how many there are; the last block may have more room.
        found: ``(P,)``.
    """
    half, width = precision(0.5), inputs + 1 + outputs
    middle, single = inputs // 2, precision is np.float32
    scale = precision(0.5 * SCALE if single else 0.5)

    def kernel(genes, bias, sizes, x, target, poses, found, start, stop):  # type: ignore[no-untyped-def]
        block = np.uint64(target.shape[1] // outputs)
        miss = aligned(target.shape[1], precision)
        constants = np.empty(outputs, precision)
        scaled = np.empty((genes.shape[1] + 1, width), precision)
        for who in range(start, stop):
            neurons = sizes[who]
            for k in range(outputs):
                constants[k] = bias[who, k]
            for neuron in range(neurons):
                for j in range(width):
                    scaled[neuron, j] = genes[who, neuron, j] * (half if j <= inputs else scale)
                for k in range(outputs):
                    constants[k] += half * genes[who, neuron, inputs + 1 + k]
            scaled[neurons] = precision(0.0)  # the partner of the last one, if their number is odd
            total = 0.0
            for part in range(len(x)):
                given, wanted = x[part], target[part]
                for k in range(outputs):  # unsigned limits, here and below: else each index is looked at
                    constant, room = constants[k], np.uint64(k) * block
                    for n in range(room, room + block):
                        miss[n] = constant - wanted[n]
                for neuron in range(0, neurons, 2):  # two at a time: the poses are loaded once for both
                    # As tuples, not arrays: else the compiler does not know that nothing in the loop changes them.
                    first = to_fixed_tuple(scaled[neuron], width)
                    second = to_fixed_tuple(scaled[neuron + 1], width)
                    for n in range(block):
                        one, other = first[inputs], second[inputs]
                        for i in range(middle):
                            one += first[i] * given[i * block + n]
                            other += second[i] * given[i * block + n]
                        one_more, other_more = precision(0.0), precision(0.0)
                        for i in range(middle, inputs):  # apart, so that one sum need not wait for the other
                            one_more += first[i] * given[i * block + n]
                            other_more += second[i] * given[i * block + n]
                        one, other = one + one_more, other + other_more
                        if single:
                            one, other = _tanh_over_scale(one), _tanh_over_scale(other)
                        else:
                            one, other = math.tanh(one), math.tanh(other)
                        for k in range(outputs):
                            so_far = miss[k * block + n] + first[inputs + 1 + k] * one
                            miss[k * block + n] = so_far + second[inputs + 1 + k] * other
                filled = min(block, np.uint64(poses) - np.uint64(part) * block)
                for k in range(outputs):
                    total += _sum_of_squares(miss, np.uint64(k) * block, np.uint64(k) * block + filled)
            found[who] = total

    return compiled(kernel, fastmath=FAST)


@partial(compiled, inline="always")
def _chance(seed, number):  # type: ignore[no-untyped-def]
    """A number from 0 to 1 (excluded): the so-many-th of splitmix64 (Steele, Lea, Flood 2014) from that seed."""
    z = seed + (np.uint64(number) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return ((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53


@compiled
def _unify(genes, length, seed, number, unified):  # type: ignore[no-untyped-def]
    """Truncates the genes or continues them at random, from the so-many-th number of the seed on."""
    for n in range(min(length, len(unified))):
        unified[n] = genes[n]
    for n in range(np.uint64(length), np.uint64(len(unified))):  # the compiler need not think of negative ones
        unified[n] = 2.0 * _chance(seed, number + n) - 1.0


@compiled
def _cross(own, length, best, one, other, factor, crossover, seed, number, trial):  # type: ignore[no-untyped-def]
    """Mutation and crossover of the numbers of one individual, of which it has only the first so many."""
    for n in range(len(one)):
        kept = n < length and _chance(seed, number + n) >= crossover
        trial[n] = own[n] if kept else best[n] + factor * (one[n] - other[n])


@compiled
def make_trials(  # type: ignore[no-untyped-def]
    genes, bias, sizes, best, factor, crossover, seeds, trial, trial_bias, start, stop
):
    """Trials by eq. 19 and 20 for the individuals from ``start`` to ``stop``; ``succession`` says what they are.

    Args:
        genes, bias, sizes: ``(P, L, d + 1 + k)``, ``(P, k)``, ``(P,)`` as a population has them.
        best, factor, crossover: who is the best; settings of the evolution, in the precision of the genes.
        seeds: ``(P,)`` unsigned, for each individual's chance: the result does not depend on the order of work.
        trial, trial_bias: like ``genes`` and ``bias``; beyond the size of the best nothing is written.
    """
    count, outputs = bias.shape
    width = genes.shape[2]
    flat, trial_flat = genes.reshape(count, -1), trial.reshape(count, -1)
    length = sizes[best] * width
    one, other = np.empty(length, genes.dtype), np.empty(length, genes.dtype)
    for who in range(start, stop):
        seed = seeds[who]
        a = int(_chance(seed, 0) * count)
        b = (a + 1 + int(_chance(seed, 1) * (count - 1))) % count
        _unify(flat[a], sizes[a] * width, seed, 2, one)
        _unify(flat[b], sizes[b] * width, seed, 2 + length, other)
        has, number = sizes[who] * width, 2 + 2 * length
        _cross(flat[who], has, flat[best], one, other, factor, crossover, seed, number, trial_flat[who])
        number += length
        _cross(bias[who], outputs, bias[best], bias[a], bias[b], factor, crossover, seed, number, trial_bias[who])


@compiled
def select(genes, bias, sizes, error, trial, trial_bias, trial_sizes, trial_error, start, stop):  # type: ignore[no-untyped-def]
    """Individuals from ``start`` to ``stop`` take the places of trials that are not better (eq. 21)."""
    for who in range(start, stop):
        if trial_error[who] < error[who]:
            trial[who, trial_sizes[who] :] = 0.0
        else:  # also if the trial's error is no number
            trial[who], trial_bias[who] = genes[who], bias[who]
            trial_sizes[who], trial_error[who] = sizes[who], error[who]
