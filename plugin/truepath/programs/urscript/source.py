"""Text of a program as logical lines: comments set aside, lines with open brackets joined, nothing lost.

Programs repeat themselves: ten thousand lines differ in their numbers only. A line is therefore split into its shape
and its slots (numbers, strings, and names with digits in them), and each shape is parsed once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from string import ascii_letters

from truepath.errors import InputError

LONGEST_LINE, MOST_JOINED, DEEPEST = 100_000, 2000, 60
LINE = re.compile(r"[^\r\n]*(?:\r\n?|\n)|[^\r\n]+\Z")
LABEL = re.compile(r"\s*\$\s*[0-9]+\b")  # PolyScope marks the nodes of its program tree: $ 3 "MoveJ"
CODE = re.compile(r"""(?:[^#"']|"[^"]*"|'[^']*')*""")
TEXTS = re.compile(r""""[^"]*"|'[^']*'""")
SLOT = re.compile(
    r"""((?<![\w.])(?:\d+\.?\d*(?:[eE][+-]?\d+)?(?!\w)|\.\d+(?:[eE][+-]?\d+)?(?!\w)|[A-Za-z_]+\d\w*)"""
    r"""|"[^"]*"|'[^']*')""",
    re.ASCII,
)
# What a slot is shows in its first character.
FIRST = {**dict.fromkeys(".0123456789", "#"), **dict.fromkeys("\"'", "s"), **dict.fromkeys(ascii_letters + "_", "n")}
KINDS = str.maketrans(FIRST)


@dataclass(slots=True, eq=False)
class Line:
    """One logical line.

    Attributes:
        number: of its first line in the file, from 1.
        start: offset of its first character in the text.
        code: without the comment; where lines were joined, comments and line ends are blanks.
        whole: with comment and line end, as in the text.
        slots: its numbers, strings and names with digits, in order.
        shape: what is left, as a key.
    """

    number: int
    start: int
    code: str
    whole: str
    slots: list[str]
    shape: str

    def slot_spans(self) -> list[tuple[int, int]]:
        """Columns of its slots in the code."""
        return [match.span() for match in SLOT.finditer(self.code)]


def logical_lines(text: str, file: str) -> Iterator[Line]:
    """Lines that hold code, in order.

    Raises:
        InputError: a line longer, or brackets deeper, than any program needs.
    """
    start, number = 0, 0
    pending: list[str] = []
    for match in LINE.finditer(text):
        whole = match[0]
        number += 1
        code = whole[: _code_end(whole)]
        if not pending and (not code.strip() or LABEL.match(code)):
            continue
        opened = _open_brackets(code)
        if not pending:
            if opened <= 0:
                yield _line(number, match.start(), code.rstrip("\r\n"), whole, file)
                continue
            start, first, balance = match.start(), number, opened
            pending = [code.ljust(len(whole))]
            continue
        balance += opened
        pending.append(code.replace("\r", " ").replace("\n", " ").ljust(len(whole)))
        if balance <= 0:
            joined = "".join(pending)
            yield _line(first, start, joined.rstrip(), text[start : match.end()], file)
            pending = []
        elif len(pending) > MOST_JOINED:
            break
    if pending:
        raise InputError("a bracket is opened and never closed", file=file, line=first, expected=") or ]")


def _code_end(whole: str) -> int:
    at = whole.find("#")
    if at < 0:
        return len(whole)
    before = whole[:at]
    if '"' not in before and "'" not in before:
        return at
    match = CODE.match(whole)
    assert match is not None
    stopped = match.end()
    # Stopped by a quotation mark that nothing closes: the grammar will say so.
    return stopped if stopped < len(whole) and whole[stopped] == "#" else len(whole)


def _open_brackets(code: str) -> int:
    if '"' in code or "'" in code:
        code = TEXTS.sub("", code)
    return code.count("(") + code.count("[") - code.count(")") - code.count("]")


def _line(number: int, start: int, code: str, whole: str, file: str) -> Line:
    code = code.replace("\r", " ").replace("\n", " ")
    if len(code) > LONGEST_LINE:
        raise InputError(
            "the line is too long",
            file=file,
            line=number,
            expected=f"{LONGEST_LINE} characters at most",
            found=str(len(code)),
        )
    parts = SLOT.split(code)
    slots = parts[1::2]
    kinds = "".join([slot[0] for slot in slots]).translate(KINDS)
    return Line(number, start, code, whole, slots, "\0".join([*parts[::2], kinds]))


def nesting(code: str) -> int:
    """How deep brackets go."""
    deepest = depth = 0
    for character in TEXTS.sub("", code):
        if character in "([":
            depth += 1
            deepest = max(deepest, depth)
        elif character in ")]":
            depth -= 1
    return deepest
