"""A URScript program: its targets, what cannot be resolved, and its text with other targets in it."""

from __future__ import annotations

import codecs
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truepath.errors import InputError
from truepath.programs.motions import Motions
from truepath.programs.program import NewTargets, Unresolved, Via
from truepath.programs.urscript.collector import collector_at_rest
from truepath.programs.urscript.follow import Follower
from truepath.programs.urscript.literals import resolve
from truepath.programs.urscript.names import moves_in
from truepath.programs.urscript.rewrite import Site, rewritten, stands_alone
from truepath.programs.urscript.targets import motions_of
from truepath.programs.urscript.tree import parse
from truepath.programs.urscript.values import Pose

NO_TOOL = Pose((0.0,) * 6)
LARGEST_FILE = 200_000_000


@dataclass(frozen=True, eq=False)
class Script:
    """A program; see ``programs.program.Program``.

    Attributes:
        file: name for messages.
        raw: its bytes.
        text: the same; bytes that are no UTF-8 are kept as surrogates.
        motions: its targets, in the order in which they are written.
        unresolved: moves that stay as they are.
        sites: per target, where it is written.
        states_tool: whether it is known with which tool it works.
        unreached: lines of moves that no way through the program leads to.
    """

    file: str
    raw: bytes
    text: str
    motions: Motions
    unresolved: tuple[Unresolved, ...]
    sites: tuple[Site, ...]
    states_tool: bool
    unreached: tuple[int, ...] = ()
    comment: str | None = "#"

    def statement(self, at: int) -> str:
        """The line of a target without its comment."""
        return self.sites[at].line.code.strip()

    def can_be_added_before(self, at: int) -> bool:
        """Whether the move of a target stands alone on its line, and goes nowhere else."""
        return stands_alone(self.sites[at])

    def rewritten(self, new: NewTargets, vias: Sequence[Via], header: str) -> bytes:
        """Its content with new targets, lines added before their moves, and a first line."""
        with collector_at_rest():
            return rewritten(self.text, self.sites, new, vias, header).encode("utf-8", "surrogateescape")


def read_bytes(path: str | Path) -> bytes:
    """The content of a program file.

    Raises:
        InputError: no such file, or one that is too large.
    """
    path = Path(path)
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError("the program is too large", file=path, expected=f"{LARGEST_FILE} bytes at most")
        return path.read_bytes()
    except OSError as error:
        raise InputError("the program cannot be read", file=path, found=error.strerror or "unreadable") from None


def parse_script(raw: bytes, file: str, tool: Sequence[float] | None = None) -> Script:
    """Reads a program.

    Args:
        raw: its bytes.
        file: name for messages.
        tool: TCP in force before the program sets one, ``(6,)`` position in m and rotation vector in rad, on the
            controller's tool flange; none if not stated.

    Raises:
        InputError: this is no URScript, with line and column; or there is nothing in it.
    """
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise InputError("the program is UTF-16", file=file, expected="UTF-8")
    if b"\0" in raw:
        line = raw[: raw.index(b"\0")].count(b"\n") + 1
        raise InputError("this is no text", file=file, line=line, expected="a program", found="a zero byte")
    text = raw.decode("utf-8", "surrogateescape")
    start = NO_TOOL if tool is None else Pose(tuple(float(each) for each in tool))
    with collector_at_rest():
        try:
            program = parse(text, file)
            if not program:
                raise InputError("the program is empty", file=file, expected="a statement at least", found="none")
            moves = Follower(program, file, start).moves
        except RecursionError:
            raise InputError("calls, blocks and brackets are too deep to be followed", file=file) from None
        resolved, left = resolve(moves)
        motions, sites = motions_of(resolved, moves.by_step, start, file)
    unreached = moves_in(program) - {step[0] for step in moves.by_step}
    unresolved = [Unresolved(move.line.number, move.line.code.strip(), str(move.problem)) for _, move in left]
    states_tool = bool(np.any(motions.tool)) or tool is not None
    return Script(file, raw, text, motions, tuple(unresolved), sites, states_tool, tuple(sorted(unreached)))
