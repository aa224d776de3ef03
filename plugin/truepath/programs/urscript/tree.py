"""A program as blocks of statements."""

from __future__ import annotations

from dataclasses import dataclass

from truepath.errors import InputError
from truepath.programs.urscript.source import Line, logical_lines
from truepath.programs.urscript.syntax import Node, Shape, Shapes

OPENS = {"function": "def", "thread": "thread", "secondary": "sec", "if_": "if", "while_": "while"}
GOES_ON = {"elif_": "elif", "else_": "else"}
DEEPEST_BLOCKS = 60


@dataclass(slots=True, eq=False)
class Statement:
    """One statement.

    Attributes:
        node: its own line, or its part of it.
        line, shape: where it stands.
        body: statements of its block; empty where it opens none.
        otherwise: for ``if_``: the ``elif_`` or ``else_`` that follows.
        alone: no other statement stands on its line.
    """

    node: Node
    line: Line
    shape: Shape
    body: list[Statement]
    otherwise: Statement | None = None
    alone: bool = True


NOTHING: list[Statement] = []


def parse(text: str, file: str) -> list[Statement]:
    """The statements of a program, outermost level.

    Raises:
        InputError: a line that is no URScript, a block that is not closed, an ``end`` too many.
    """
    shapes = Shapes(file)
    top: list[Statement] = []
    open_blocks: list[Statement] = []
    bodies = [top]
    for line in logical_lines(text, file):
        shape = shapes.of(line)
        alone = len(shape.items) == 1
        for node in shape.items:
            op = node.op
            if op == "end":
                if not open_blocks:
                    raise InputError("an 'end' too many", file=file, line=line.number)
                open_blocks.pop()
                bodies.pop()
                continue
            opens = op in OPENS or op in GOES_ON
            statement = Statement(node, line, shape, [] if opens else NOTHING, alone=alone)
            if op in GOES_ON:
                opened = open_blocks.pop() if open_blocks else None
                if opened is None or opened.node.op not in ("if_", "elif_"):
                    raise InputError(f"'{GOES_ON[op]}' without an 'if'", file=file, line=line.number)
                opened.otherwise = statement
                bodies.pop()
            else:
                bodies[-1].append(statement)
            if opens:
                if len(open_blocks) >= DEEPEST_BLOCKS:
                    raise InputError("blocks too deep", file=file, line=line.number, expected=f"{DEEPEST_BLOCKS}")
                open_blocks.append(statement)
                bodies.append(statement.body)
    if open_blocks:
        opened = open_blocks[-1]
        word = (OPENS | GOES_ON)[opened.node.op]
        raise InputError(f"'{word}' is not closed", file=file, line=opened.line.number, expected="end")
    return top
