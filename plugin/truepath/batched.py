"""A CasADi function of one pose, evaluated for many poses in place.

CasADi reads and writes numpy memory directly: converting its matrices would take longer than evaluating them.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from truepath.lie import Array

BLOCK = 512  # poses; to prepare a function for more at once takes longer than it saves


class BatchedFunction:
    """Maps a function over N poses.

    Args:
        function: of one pose; its inputs and outputs are dense.
        inputs: one array per input. Per-pose ones are ``(N, ...)``; matrices of a pose are column-major, that
            is ``(N, columns, rows)``. Inputs named in ``common`` are one matrix for all poses.
        common: numbers of the inputs that all poses share.

    Attributes:
        inputs: float copies of the inputs; change them in place before the next call.
        outputs: ``(N, columns, rows)`` per output, overwritten by the next call.
    """

    def __init__(self, function: ca.Function, inputs: list[Array], common: tuple[int, ...] = ()) -> None:
        N = next(len(array) for index, array in enumerate(inputs) if index not in common)
        blocks = -(-N // BLOCK)
        block = -(-N // max(blocks, 1))  # of nearly equal size, so that little is padded
        padded = blocks * block
        shapes = [function.size_out(index) for index in range(function.n_out())]
        memory_out = [np.empty((padded, columns, rows)) for rows, columns in shapes]
        memory_in = [
            np.array(array, float, order="C") if index in common else _padded(array, padded)
            for index, array in enumerate(inputs)
        ]
        self.inputs = [array if index in common else array[:N] for index, array in enumerate(memory_in)]
        self.outputs = [array[:N] for array in memory_out]
        self._calls = []
        for first in range(0, padded, max(block, 1)):
            mapped = _mapped(function, block, common)
            buffer, trigger = mapped.buffer()
            for index, array in enumerate(memory_in):
                part = array if index in common else array[first : first + block]
                buffer.set_arg(index, memoryview(part))  # type: ignore[call-arg, arg-type]
            for index, array in enumerate(memory_out):
                buffer.set_res(index, memoryview(array[first : first + block]))  # type: ignore[call-arg, arg-type]
            self._calls.append((buffer, trigger))  # the buffer must live as long as its trigger

    def __call__(self) -> list[Array]:
        """Evaluates; returns ``outputs``."""
        for _, trigger in self._calls:
            trigger()
        return self.outputs


@lru_cache(maxsize=64)
def _mapped(function: ca.Function, size: int, common: tuple[int, ...]) -> ca.Function:
    return function.map(f"{function.name()}_{size}", "serial", size, list(common), [])


def _padded(array: Array, length: int) -> Array:
    """A float copy with its last row repeated up to a length."""
    out = np.empty((length, *array.shape[1:]))
    out[: len(array)] = array
    out[len(array) :] = array[-1:]
    return out
