"""The text of a program with other targets in it, and with targets added; every other byte stays."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from truepath.lie import Array
from truepath.programs.program import NewTargets, Via
from truepath.programs.urscript.moves import MOVES, Literal, Move, literal, named
from truepath.programs.urscript.source import Line
from truepath.programs.urscript.syntax import Node, columns
from truepath.programs.urscript.values import JointsOf
from truepath.programs.urscript.written import Written

LINE_END = re.compile(r"\r\n?|\n")
DECIMALS = 9  # a nanometre, a nanoradian
JOINTS_TEXT = "[" + ", ".join([f"%.{DECIMALS}f"] * 6) + "]"


class Site(NamedTuple):
    """Where a target is written.

    Attributes:
        move: to which it belongs.
        which: of the targets of the move it is.
        literal: that stands elsewhere and is handed to the move; None: the move's own argument.
    """

    move: Move
    which: int
    literal: Written | None

    @property
    def line(self) -> Line:
        return self.move.line if self.literal is None else self.literal.line


def rewritten(text: str, sites: Sequence[Site], new: NewTargets, vias: Sequence[Via] = (), header: str = "") -> str:
    """The program with new targets, with vias added before their moves, and with a header line at its start."""
    texts = _texts(new)
    edits: list[tuple[int, int, str]] = []
    for at, text_of_it, is_pose, near in zip(
        new.index.tolist(), texts, new.is_pose.tolist(), new.q_near_rad, strict=True
    ):
        edits.append(_edit(sites[at], text_of_it, is_pose, near))
    by_move: dict[int, list[Via]] = {}
    for via in vias:
        by_move.setdefault(via.before, []).append(via)
    for at, added in by_move.items():
        move = sites[at].move
        end = _line_end(move.line.whole, _line_end(text))
        edits.append((move.line.start, move.line.start, "".join(_via_line(move, via, end) for via in added)))
        edits += _rest_of_the_time(move, 1.0 - sum(via.share for via in added))
    text = _applied(text, edits)
    if header:
        mark = "\ufeff" if text.startswith("\ufeff") else ""
        text = f"{mark}{header}{_line_end(text)}{text[len(mark) :]}"
    return text


def stands_alone(site: Site) -> bool:
    """Whether nothing else stands on the line of a move, so that another line can be put before it.

    A move that takes several literals goes elsewhere each time: no line before it would do for all.
    """
    move, node = site.move, site.move.statement.node
    return site.literal is None and move.statement.alone and node.op == "expression" and node.args[0] is move.node


def _applied(text: str, edits: list[tuple[int, int, str]]) -> str:
    parts, known = [], 0
    for start, end, new in sorted(edits, key=lambda edit: edit[:2]):
        parts += [text[known:start], new]
        known = end
    return "".join([*parts, text[known:]])


def _line_end(text: str, otherwise: str = "\n") -> str:
    """The first line end of a text."""
    found = LINE_END.search(text)
    return otherwise if found is None else found[0]


def _texts(new: NewTargets) -> list[str]:
    # Rounded first: what is nothing to nine decimals must not read -0.
    rounded = np.round(new.values, DECIMALS) + 0.0
    return [
        ("p" if is_pose else "") + JOINTS_TEXT % tuple(row)
        for row, is_pose in zip(rounded.tolist(), new.is_pose.tolist(), strict=True)
    ]


def _edit(site: Site, text: str, is_pose: bool, near: Array) -> tuple[int, int, str]:
    move, which, written = site
    shape, line = (move.statement.shape, move.line) if written is None else (written.shape, written.line)
    plain = literal(shape) if not move.targets else None
    node = _target_node(plain, move, which) if written is None else written.node
    if is_pose:
        node, text = _as_pose(node, text, move, which, near)
    start, end = columns(node, shape, line)
    old = line.code[start:end]
    if plain is not None and ", " not in old:
        text = text.replace(", ", ",")
    return line.start + start, line.start + end, text


def _target_node(plain: Literal | None, move: Move, which: int) -> Node:
    if plain is not None:
        return _by_name(plain.node, move.name)[MOVES[move.name].targets[which]]
    return _by_name(move.node, move.name)[MOVES[move.name].targets[which]]


def _by_name(call: Node, name: str) -> dict[str, Node]:
    given = named(MOVES[name], call)
    assert given is not None
    return given


def _as_pose(node: Node, text: str, move: Move, which: int, near: Array) -> tuple[Node, str]:
    """Where a pose goes and how it is written: a move by joints needs to know the posture, or it might take another."""
    value = move.targets[which] if move.targets else None
    if isinstance(value, JointsOf) and node.op == "call" and node.args[0] == "get_inverse_kin":
        first = node.args[1][0]
        pose = first if first.op != "keyword" else next(e.args[1] for e in node.args[1] if e.args[0] == "x")
        return pose, text
    held_joints = isinstance(value, (JointsOf, tuple)) or (value is None and node.op == "list_")
    if held_joints and move.name in ("movej", "servoj"):
        joints = JOINTS_TEXT % tuple((np.round(near, DECIMALS) + 0.0).tolist())
        return node, f"get_inverse_kin({text}, qnear={joints})"
    return node, text


def _via_line(move: Move, via: Via, line_end: str) -> str:
    """The move once more with other targets and its own blend, on a line of its own."""
    line, shape = move.line, move.statement.shape
    indentation = line.whole[: len(line.whole) - len(line.whole.lstrip())]
    signature = MOVES[move.name]
    joints = [JOINTS_TEXT % tuple((np.round(values, DECIMALS) + 0.0).tolist()) for values in via.values]
    texts = {name: ("p" if via.is_pose else "") + each for name, each in zip(signature.targets, joints, strict=True)}
    given = _by_name(move.node, move.name)
    for name, node in given.items():
        if name not in signature.targets:
            start, end = columns(node, shape, line)
            texts[name] = " ".join(line.code[start:end].split())
    time = _stated_time(move)
    if time is not None:
        texts["t"] = f"{via.share:.6f}*({texts['t']})"
    texts["r"] = f"{via.blend_m:.6f}"
    stated = ", ".join(value if name in signature.targets else f"{name}={value}" for name, value in texts.items())
    return f"{indentation}{move.name}({stated}){line_end}"


def _stated_time(move: Move) -> Node | None:
    """Where a move states its time, if it states one that counts."""
    node = _by_name(move.node, move.name).get("t")
    if node is None:
        return None
    zero = node.op == "number" and node.slot >= 0 and float(move.line.slots[node.slot]) == 0.0
    return None if zero else node


def _rest_of_the_time(move: Move, share: float) -> list[tuple[int, int, str]]:
    node = _stated_time(move)
    if node is None:
        return []
    start, end = columns(node, move.statement.shape, move.line)
    old = move.line.code[start:end]
    return [(move.line.start + start, move.line.start + end, f"{share:.6f}*({old})")]
