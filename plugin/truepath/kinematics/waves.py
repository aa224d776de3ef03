"""Expressions as graphs in which nothing occurs twice, and sines of multiples of an angle without further sines."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any, Literal

import casadi as ca

ROUNDING = 1e-12  # of a multiple that is a whole number
Kind = Literal["input", "constant", "operation"]


class Graph:
    """Nodes are numbers; equal operations on equal operands are one node.

    Sines and cosines of several multiples of one angle follow from each other,

        cos((a + b) x) = 2 cos(a x) cos(b x) - cos((a - b) x),  sin((a + b) x) = 2 sin(a x) cos(b x) - sin((a - b) x),

    to some 1e-16 (a + b)^2, for a tenth of the time of a sine.

    Args:
        sines: input number of an angle to those of its sine and its cosine, where these are inputs too.
    """

    def __init__(self, sines: dict[int, tuple[int, int]]) -> None:
        self._sines = sines
        self._nodes: list[tuple[Any, ...]] = []
        self._number: dict[tuple[Any, ...], int] = {}
        self._made: dict[tuple[int, float, int, int], int] = {}

    def rebuilt(self, operations: Sequence[tuple[Any, ...]], outputs: Sequence[int]) -> list[int]:
        """Nodes of the outputs of a list of operations, each of which refers to earlier ones by their place."""
        node: list[int] = []
        for kind, *rest in operations:
            node.append(self._add(kind, rest[0], *(node[used] for used in rest[1:])))
        wanted = [node[place] for place in outputs]
        waves = self._waves(self.needed(wanted))
        new: dict[int, int] = {}
        for old in self.needed(wanted):
            entry = self._nodes[old]
            if old in waves:
                base, unit, multiple, wave = waves[old]
                for smaller in self._orders[base]:  # those that follow from others come behind them
                    self._wave(new[base], unit, smaller, wave)
                new[old] = self._wave(new[base], unit, multiple, wave)
            elif entry[0] == "operation":
                new[old] = self._add("operation", entry[1], *(new[used] for used in entry[2:]))
            else:
                new[old] = old
        return [new[old] for old in wanted]

    def needed(self, outputs: Sequence[int]) -> list[int]:
        """Nodes on which these depend, and themselves, each behind its operands."""
        seen: set[int] = set()
        order: list[int] = []
        stack = [(node, False) for node in reversed(outputs)]
        while stack:
            node, ready = stack.pop()
            if ready:
                order.append(node)
            elif node not in seen:
                seen.add(node)
                stack.append((node, True))
                stack += [(used, False) for used in reversed(self.operands(node))]
        return order

    def kind(self, node: int) -> Kind:
        return self._nodes[node][0]

    def constant(self, node: int) -> float | None:
        """Its value; None if it is none."""
        return self._nodes[node][1] if self.kind(node) == "constant" else None

    def input_number(self, node: int) -> int:
        return self._nodes[node][1]

    def operation(self, node: int) -> int:
        """Code of CasADi."""
        return self._nodes[node][1]

    def operands(self, node: int) -> tuple[int, ...]:
        return self._nodes[node][2:]

    def _add(self, *entry: Any) -> int:
        if entry not in self._number:
            self._number[entry] = len(self._nodes)
            self._nodes.append(entry)
        return self._number[entry]

    def _operation(self, code: int, *operands: int) -> int:
        return self._add("operation", code, *operands)

    def _waves(self, nodes: Sequence[int]) -> dict[int, tuple[int, float, int, int]]:
        """Of each sine and cosine that can follow from others: angle, its unit, the whole multiple, and which it is."""
        of_base: dict[int, list[tuple[int, float]]] = defaultdict(list)
        for node in nodes:
            if self.kind(node) == "operation" and self.operation(node) in (ca.OP_SIN, ca.OP_COS):
                factor, base = self._multiple(self.operands(node)[0])
                if factor > 0.0:
                    of_base[base].append((node, factor))
        found: dict[int, tuple[int, float, int, int]] = {}
        self._orders: dict[int, list[int]] = {}
        for base, waves in of_base.items():
            is_angle = self.kind(base) == "input" and self.input_number(base) in self._sines
            unit = 1.0 if is_angle else min(factor for _, factor in waves)
            multiples = [round(factor / unit) for _, factor in waves]
            if any(
                abs(factor / unit - m) > ROUNDING * max(m, 1) for (_, factor), m in zip(waves, multiples, strict=True)
            ):
                continue
            self._orders[base] = sorted(set(multiples))
            for (node, _), m in zip(waves, multiples, strict=True):
                found[node] = base, unit, m, self.operation(node)
        return found

    def _multiple(self, node: int) -> tuple[float, int]:
        """Factor and node of which another is a multiple."""
        if self.kind(node) == "operation":
            if self.operation(node) == ca.OP_TWICE:
                factor, base = self._multiple(self.operands(node)[0])
                return 2.0 * factor, base
            if self.operation(node) == ca.OP_MUL:
                first, second = self.operands(node)
                for constant, other in ((first, second), (second, first)):
                    value = self.constant(constant)
                    if value is not None:
                        factor, base = self._multiple(other)
                        return value * factor, base
        return 1.0, node

    def _wave(self, base: int, unit: float, multiple: int, wave: int) -> int:
        """Node of the cosine or sine of ``multiple * unit * base``."""
        key = base, unit, multiple, wave
        if key not in self._made:
            self._made[key] = self._new_wave(base, unit, multiple, wave)
        return self._made[key]

    def _new_wave(self, base: int, unit: float, multiple: int, wave: int) -> int:
        if multiple == 0:
            return self._add("constant", 1.0 if wave == ca.OP_COS else 0.0)
        if multiple == 1:
            if self.kind(base) == "input" and self.input_number(base) in self._sines:
                return self._add("input", self._sines[self.input_number(base)][int(wave == ca.OP_COS)])
            angle = base if unit == 1.0 else self._operation(ca.OP_MUL, self._add("constant", unit), base)
            return self._operation(wave, angle)
        made = {(base, unit, multiple - k, wave) for k in (1, 2)} <= self._made.keys()
        b = 1 if made or multiple == 2 else multiple // 2
        a = multiple - b
        part, cosine, before = (
            self._wave(base, unit, m, kind) for m, kind in ((a, wave), (b, ca.OP_COS), (a - b, wave))
        )
        product = self._operation(ca.OP_MUL, part, self._operation(ca.OP_TWICE, cosine))
        return product if self.constant(before) == 0.0 else self._operation(ca.OP_SUB, product, before)
