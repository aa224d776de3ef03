"""A CasADi function of one pose, executed operation by operation on rows that hold many poses.

An effect states its formula once, in CasADi. Here the formula is taken apart into its operations and each becomes
one call of numpy on a row. What occurs more than once is computed once, over all effects together.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from scipy.special import erf

from truepath.kinematics.waves import Graph
from truepath.lie import Array


def _if_else_zero(condition: Array, value: Array, out: Array) -> Array:
    out[...] = np.where(condition, value, 0.0)
    return out


def _with_out(ufunc: Callable[..., Any]) -> Callable[..., Any]:
    """numpy takes the result of these by name only."""
    return lambda a, b, out: ufunc(a, b, out=out)


UFUNCS: dict[int, Callable[..., Any]] = {
    ca.OP_ASSIGN: np.positive, ca.OP_ADD: np.add, ca.OP_SUB: np.subtract, ca.OP_MUL: np.multiply, ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative, ca.OP_EXP: np.exp, ca.OP_LOG: np.log, ca.OP_POW: np.power, ca.OP_CONSTPOW: np.power,
    ca.OP_SQRT: np.sqrt, ca.OP_SQ: np.square, ca.OP_TWICE: lambda a, out: np.add(a, a, out), ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos, ca.OP_TAN: np.tan, ca.OP_ASIN: np.arcsin, ca.OP_ACOS: np.arccos, ca.OP_ATAN: np.arctan,
    ca.OP_LT: np.less, ca.OP_LE: np.less_equal, ca.OP_EQ: np.equal, ca.OP_NE: np.not_equal, ca.OP_NOT: np.logical_not,
    ca.OP_AND: np.logical_and, ca.OP_OR: np.logical_or, ca.OP_FLOOR: np.floor, ca.OP_CEIL: np.ceil,
    ca.OP_FMOD: np.fmod, ca.OP_FABS: np.abs, ca.OP_SIGN: np.sign, ca.OP_COPYSIGN: np.copysign,
    ca.OP_IF_ELSE_ZERO: _if_else_zero, ca.OP_ERF: erf, ca.OP_FMIN: _with_out(np.fmin), ca.OP_FMAX: _with_out(np.fmax),
    ca.OP_INV: np.reciprocal, ca.OP_SINH: np.sinh, ca.OP_COSH: np.cosh, ca.OP_TANH: np.tanh, ca.OP_ASINH: np.arcsinh,
    ca.OP_ACOSH: np.arccosh, ca.OP_ATANH: np.arctanh, ca.OP_ATAN2: np.arctan2, ca.OP_EXPM1: np.expm1,
    ca.OP_LOG1P: np.log1p, ca.OP_HYPOT: np.hypot,
}  # fmt: skip
PAIRS = {
    ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV, ca.OP_POW, ca.OP_CONSTPOW, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE,
    ca.OP_AND, ca.OP_OR, ca.OP_FMOD, ca.OP_COPYSIGN, ca.OP_IF_ELSE_ZERO, ca.OP_FMIN, ca.OP_FMAX, ca.OP_ATAN2,
    ca.OP_HYPOT,
}  # fmt: skip


class VectorProgram:
    """Evaluates the entries of an expression that are not constant, each different one once.

    Args:
        inputs: ``(I, 1)`` symbols.
        outputs: ``(K, 1)`` expressions in these, in the order in which their rows shall lie.
        sines: symbol number of an angle to those of its sine and its cosine, where these are inputs too.

    Attributes:
        row: ``(K,)`` number of the row that holds each output, -1 for a constant.
        constant: ``(K,)`` its value, 0 where it is none.
        num_rows: how many there are.
    """

    def __init__(self, inputs: ca.SX, outputs: ca.SX, sines: dict[int, tuple[int, int]]) -> None:
        function = ca.Function("rows", [inputs], [ca.densify(outputs)])
        graph, found = Graph(sines), _read(function)
        nodes = graph.rebuilt(*found)
        self.row, self.constant = np.full(len(nodes), -1), np.zeros(len(nodes))
        rows: dict[int, int] = {}
        for k, node in enumerate(nodes):
            value = graph.constant(node)
            if value is None:
                self.row[k] = rows.setdefault(node, len(rows))
            else:
                self.constant[k] = value
        self.num_rows = len(rows)
        self._graph, self._rows = graph, rows
        self._order = graph.needed(list(rows))

    def bound_to(self, x: Array, out: Array) -> Callable[[], None]:
        """Function that fills rows ``out (num_rows, N)`` from inputs ``x (I, N)``, the same memory at each call."""
        graph, last_use = self._graph, {}
        for node in self._order:
            for used in graph.operands(node):
                last_use[used] = node
        memory: dict[int, Array] = {}
        free: list[Array] = []
        steps: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []
        for node in self._order:
            kind = graph.kind(node)
            if kind == "input":
                memory[node] = x[graph.input_number(node)]
                if node in self._rows:
                    steps.append((np.positive, (memory[node], out[self._rows[node]])))
                continue
            if kind == "constant":
                memory[node] = np.array(graph.constant(node))
                continue
            operands = graph.operands(node)
            arguments = [memory[used] for used in operands]
            for used in set(operands):
                scratch = graph.kind(used) == "operation" and used not in self._rows
                if scratch and last_use[used] == node:
                    free.append(memory[used])
            if node in self._rows:
                memory[node] = out[self._rows[node]]
            else:
                memory[node] = free.pop() if free else np.empty(x.shape[1])
            steps.append((UFUNCS[graph.operation(node)], (*arguments, memory[node])))

        def run() -> None:
            for ufunc, arguments in steps:
                ufunc(*arguments)

        return run


def _read(function: ca.Function) -> tuple[list[tuple[Any, ...]], list[int]]:
    """Operations of a function in the order of their execution, and the numbers of those that are its outputs.

    CasADi lets operations share memory; here each has a number of its own, which others refer to.
    """
    operations: list[tuple[Any, ...]] = []
    holds: dict[int, int] = {}  # place in CasADi's memory to the operation whose result is there
    outputs = [-1] * function.nnz_out(0)
    for k in range(function.n_instructions()):
        code, places = function.instruction_id(k), function.instruction_input(k)
        if code == ca.OP_OUTPUT:
            outputs[function.instruction_output(k)[1]] = holds[places[0]]
            continue
        if code == ca.OP_INPUT:
            operations.append(("input", places[1]))
        elif code == ca.OP_CONST:
            operations.append(("constant", function.instruction_constant(k)))
        elif code in UFUNCS:
            used = [holds[place] for place in (places if code in PAIRS else places[:1])]
            operations.append(("operation", code, *used))
        else:
            raise TypeError(f"an expression has an operation, number {code} of CasADi, that rows do not know")
        holds[function.instruction_output(k)[0]] = len(operations) - 1
    return operations, outputs
