"""A CasADi function of one pose, evaluated for many poses in place.

CasADi reads and writes numpy memory directly: converting its matrices would take longer than evaluating them.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from truepath.lie import Array


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
        self.inputs = [np.array(array, float, order="C") for array in inputs]
        N = next(len(array) for index, array in enumerate(inputs) if index not in common)
        shapes = [function.size_out(index) for index in range(function.n_out())]
        self.outputs = [np.empty((N, columns, rows)) for rows, columns in shapes]
        mapped = function.map(f"{function.name()}_map", "serial", N, list(common), [])
        self._buffer, self._trigger = mapped.buffer()
        for index, array in enumerate(self.inputs):
            self._buffer.set_arg(index, memoryview(array))  # type: ignore[call-arg, arg-type]
        for index, array in enumerate(self.outputs):
            self._buffer.set_res(index, memoryview(array))  # type: ignore[call-arg, arg-type]

    def __call__(self) -> list[Array]:
        """Evaluates; returns ``outputs``."""
        self._trigger()
        return self.outputs
