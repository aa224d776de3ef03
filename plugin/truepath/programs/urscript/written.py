"""Literals that are handed on unchanged: a target in a variable, or given to a function, and where it was written."""

from __future__ import annotations

from dataclasses import dataclass

from truepath.programs.urscript.source import Line
from truepath.programs.urscript.syntax import Node, Shape
from truepath.programs.urscript.values import Value

Key = tuple[int, int]  # line, column in the shape


@dataclass(frozen=True, slots=True)
class Written:
    """A pose or joints just as ``p[...]`` or ``[...]`` states them.

    Attributes:
        value: Pose or tuple.
        line, shape, node: where that is written.
    """

    value: Value
    line: Line
    shape: Shape
    node: Node

    @property
    def key(self) -> Key:
        return self.line.number, self.node.start

    def is_part_of(self, node: Node, line: Line) -> bool:
        """Whether it stands inside a node of that line."""
        return self.line is line and node.start <= self.node.start and self.node.end <= node.end


def plain(value: Value | Written) -> Value:
    """The value alone."""
    return value.value if isinstance(value, Written) else value
