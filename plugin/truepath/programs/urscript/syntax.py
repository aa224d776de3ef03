"""One line of URScript as nodes, after the grammar in ``grammar.lark``; lines of one shape share their nodes."""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truepath.errors import InputError
from truepath.programs.urscript.source import DEEPEST, Line, nesting

if TYPE_CHECKING:
    from lark import Lark, Token, Tree

KEPT_SHAPES, KEPT_FOR_OTHERS, DEEPEST_NODES = 20_000, 2000, 200
MOST_PARSED = 120_000  # words and signs; a line that differs from one before it in numbers only is not parsed again
WORDS = re.compile(r"\w+|[^\w\s]")
UNFOLDED = {"positional", "group", "positive"}


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """Part of a line.

    Attributes:
        op: rule of the grammar, such as ``add``, ``call``, ``pose``, ``assign``.
        args: nodes, words of the grammar, or None.
        slot: for a leaf with its own slot: which one; -1 otherwise.
        start, end: columns in the line that was parsed; see ``columns``.
    """

    op: str
    args: tuple[Any, ...]
    slot: int
    start: int
    end: int


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """What all lines of one shape have in common.

    Attributes:
        items: statements and parts of statements.
        spans: columns of the slots in the line that was parsed.
        calls: names of the functions that it calls: words, or nodes with a slot.
    """

    items: tuple[Node, ...]
    spans: tuple[tuple[int, int], ...]
    calls: tuple[Node | str, ...]


_OF_ALL_PROGRAMS: dict[str, Shape] = {}  # programs of one cell are alike


class Shapes:
    """Parses lines, each shape once.

    A number that stands for a joint or a name is a slot of its line, so nodes say which one.
    """

    def __init__(self, file: str) -> None:
        self.file = file
        self._known: dict[str, Shape] = {}
        self._parsed_so_far = 0

    def of(self, line: Line) -> Shape:
        """The shape of a line.

        Raises:
            InputError: this is no URScript; with line and column.
        """
        shape = self._known.get(line.shape)
        if shape is None:
            shape = self._first(line)
            if len(self._known) < KEPT_SHAPES:
                self._known[line.shape] = shape
        return shape

    def _first(self, line: Line) -> Shape:
        """The shape of a line that is the first of its shape in the program."""
        self._parsed_so_far += len(WORDS.findall(line.code))
        if self._parsed_so_far > MOST_PARSED:
            raise InputError("too many different statements for one program", file=self.file, line=line.number)
        shape = _OF_ALL_PROGRAMS.get(line.shape)
        if shape is None:
            shape = self._parsed(line)
            if len(_OF_ALL_PROGRAMS) >= KEPT_FOR_OTHERS:
                _OF_ALL_PROGRAMS.clear()
            _OF_ALL_PROGRAMS[line.shape] = shape
        return shape

    def _parsed(self, line: Line) -> Shape:
        from lark.exceptions import UnexpectedInput

        if nesting(line.code) > DEEPEST:
            raise InputError("brackets too deep", file=self.file, line=line.number, expected=f"{DEEPEST} at most")
        try:
            tree = _parser().parse(line.code)
        except UnexpectedInput as error:
            raise self._complaint(line, error) from None
        spans = tuple(line.slot_spans())
        slots = {start: index for index, (start, _) in enumerate(spans)}
        calls = tuple(_node(call.children[0], slots) for call in tree.find_data("call"))
        try:
            return Shape(tuple(_node(item, slots) for item in tree.children), spans, calls)
        except _TooDeep:
            raise InputError("the expression is too deep", file=self.file, line=line.number) from None

    def _complaint(self, line: Line, error: Any) -> InputError:
        at = getattr(error, "pos_in_stream", None)
        at = len(line.code.rstrip()) if at is None or at < 0 else at
        found = line.code[at : at + 30].strip()
        return InputError(
            "this is not understood",
            file=self.file,
            line=line.number,
            column=str(at + 1),
            expected="a statement of URScript",
            found=repr(found) if found else "the end of the line",
        )


def columns(node: Node, shape: Shape, line: Line) -> tuple[int, int]:
    """Columns of a node in a line of that shape: slots may be longer or shorter than in the line that was parsed."""
    here = line.slot_spans()
    # A node begins with a slot or after some, and ends with a slot or after some.
    begun = bisect_left(shape.spans, (node.start,)) - 1
    ended = bisect_right(shape.spans, (node.end,), key=lambda span: (span[1],)) - 1
    shift_start = here[begun][1] - shape.spans[begun][1] if begun >= 0 else 0
    shift_end = here[ended][1] - shape.spans[ended][1] if ended >= 0 else 0
    return node.start + shift_start, node.end + shift_end


class _TooDeep(Exception):  # noqa: N818
    """No expression that a person or a post-processor writes."""


@lru_cache(maxsize=1)
def _parser() -> Lark:
    from lark import Lark

    grammar = (Path(__file__).parent / "grammar.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", propagate_positions=True, maybe_placeholders=True)


def _node(tree: Tree[Token] | Token | None, slots: dict[int, int], depth: int = 0) -> Any:
    from lark import Token

    if tree is None:
        return None
    if depth > DEEPEST_NODES:
        raise _TooDeep
    if isinstance(tree, Token):
        # A token with its own slot differs from line to line.
        at = tree.start_pos or 0
        slot = slots.get(at, -1)
        return Node("token", (str(tree),), slot, at, tree.end_pos or at) if slot >= 0 else str(tree)
    children = tree.children
    if tree.data in UNFOLDED:
        return _node(children[0], slots, depth + 1)
    if tree.data in ("number", "string", "name"):
        token = children[0]
        assert isinstance(token, Token)
        at = token.start_pos or 0
        return Node(str(tree.data), (str(token),), slots.get(at, -1), at, token.end_pos or at)
    args = []
    for child in children:
        if not isinstance(child, Token) and child is not None and child.data in ("list", "arguments"):
            args.append(tuple(_node(each, slots, depth + 1) for each in child.children))
        else:
            args.append(_node(child, slots, depth + 1))
    meta = tree.meta
    return Node(str(tree.data), tuple(args), -1, getattr(meta, "start_pos", 0), getattr(meta, "end_pos", 0))
