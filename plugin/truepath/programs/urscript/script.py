"""A URScript program: its targets, what cannot be resolved, and its text with other targets in it."""

from __future__ import annotations

import codecs
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from truepath.errors import InputError
from truepath.lie import Array, make_pose
from truepath.programs.motions import Kind, Motions
from truepath.programs.program import NewTargets, Unresolved, Via
from truepath.programs.urscript.follow import Follower
from truepath.programs.urscript.moves import MOVES, Key, Move, literal
from truepath.programs.urscript.rewrite import rewritten, stands_alone
from truepath.programs.urscript.state import ELSEWHERE, START
from truepath.programs.urscript.tree import parse
from truepath.programs.urscript.values import JointsOf, Pose, Value, is_number, matrix

NO_TOOL = Pose((0.0,) * 6)
LARGEST_FILE = 200_000_000
SETTINGS = ("v", "a", "t", "r")
FARTHEST_M = 1000.0


@dataclass(frozen=True, eq=False)
class Script:
    """A program; see ``programs.program.Program``.

    Attributes:
        file: name for messages.
        raw: its bytes.
        text: the same; bytes that are no UTF-8 are kept as surrogates.
        motions: its targets, in the order in which they are written.
        unresolved: moves that stay as they are.
        sites: per target, the move that it belongs to and which of its targets it is.
        states_tool: whether it is known with which tool it works.
    """

    file: str
    raw: bytes
    text: str
    motions: Motions
    unresolved: tuple[Unresolved, ...]
    sites: tuple[tuple[Move, int], ...]
    states_tool: bool
    comment: str | None = "#"

    def statement(self, at: int) -> str:
        """The line of a target without its comment."""
        return self.sites[at][0].line.code.strip()

    def can_be_added_before(self, at: int) -> bool:
        """Whether the move of a target stands alone on its line."""
        return stands_alone(self.sites[at][0])

    def rewritten(self, new: NewTargets, vias: Sequence[Via], header: str) -> bytes:
        """Its content with new targets, lines added before their moves, and a first line."""
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
        InputError: this is no URScript; with line and column.
    """
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise InputError("the program is UTF-16", file=file, expected="UTF-8")
    if b"\0" in raw:
        line = raw[: raw.index(b"\0")].count(b"\n") + 1
        raise InputError("this is no text", file=file, line=line, expected="a program", found="a zero byte")
    text = raw.decode("utf-8", "surrogateescape")
    start = NO_TOOL if tool is None else Pose(tuple(float(each) for each in tool))
    moves = Follower(parse(text, file), file, start).moves.by_key
    resolved: list[tuple[Key, Move]] = []
    unresolved = []
    for key in sorted(moves):
        move = moves[key]
        if move.problem is None:
            resolved.append((key, move))
        else:
            unresolved.append(Unresolved(move.line.number, move.line.code.strip(), move.problem))
    motions, sites = _motions(resolved, moves, start, file)
    return Script(file, raw, text, motions, tuple(unresolved), sites, bool(np.any(motions.tool)) or tool is not None)


def _motions(
    resolved: list[tuple[Key, Move]], moves: Mapping[Key, Move], start: Pose, file: str
) -> tuple[Motions, tuple[tuple[Move, int], ...]]:
    tools: dict[Value, int] = {start: 0}
    sites: list[tuple[Move, int]] = []
    last_site: dict[Key, int] = {}
    by_shape: dict[int, list[int]] = {}
    for number, (key, move) in enumerate(resolved):
        if not move.targets:
            by_shape.setdefault(id(move.statement.shape), []).append(number)
        sites += [(move, which) for which in range(len(MOVES[move.name].kinds))]
        last_site[key] = len(sites) - 1
    count = len(sites)
    first_site = np.array([last_site[key] - len(MOVES[move.name].kinds) + 1 for key, move in resolved], int)
    q, pose, near = (np.full((count, 6), np.nan) for _ in range(3))
    settings = {name: np.full(count, np.nan) for name in SETTINGS}
    for numbers in by_shape.values():
        _fill_literal([resolved[number][1] for number in numbers], first_site[numbers], q, pose, settings)
    for at, (move, which) in enumerate(sites):
        if not move.targets:
            continue
        target = move.targets[which]
        if isinstance(target, Pose):
            pose[at] = target.values
        elif isinstance(target, JointsOf):
            pose[at] = target.pose.values
            near[at] = np.nan if target.q_near is None else target.q_near
        else:
            q[at] = target
        for name in SETTINGS:
            value = move.settings.get(name)
            if is_number(value):
                settings[name][at] = value
    previous, origin = np.full(count, -1), np.full(count, -1)
    kind, tool, line = (np.zeros(count, int) for _ in range(3))
    starts = np.zeros(count, bool)
    for at, (move, which) in enumerate(sites):
        kind[at] = MOVES[move.name].kinds[which]
        line[at] = move.line.number
        tool[at] = tools.setdefault(move.tool, len(tools)) if isinstance(move.tool, Pose) else 0
        if which:
            previous[at] = origin[at] = at - 1
            continue
        starts[at] = START in move.previous
        if len(move.previous) == 1:
            (only,) = move.previous
            previous[at] = last_site.get(only, -1)
        origin[at] = last_site.get(_last_resolved(move, moves), -1)
    _require_sense(q, pose, line, file)
    X_CT = make_pose(Rotation.from_rotvec(np.nan_to_num(pose[:, 3:])).as_matrix(), pose[:, :3])
    motions = Motions(
        kind=kind,
        q_rad=q,
        X_CT=X_CT,
        q_near_rad=near,
        tools=np.stack([matrix(each) for each in tools]),
        tool=tool,
        line=line,
        previous=previous,
        origin=origin,
        starts=starts,
        speed=settings["v"],
        acceleration=settings["a"],
        time_s=np.where(settings["t"] > 0, settings["t"], np.nan),  # zero: by speed and acceleration
        blend_m=np.where(kind == Kind.THROUGH, np.nan, settings["r"]),
    )
    return motions, tuple(sites)


def _last_resolved(move: Move, moves: Mapping[Key, Move]) -> Key:
    """The move before one, past those along lines that cannot be resolved: on a line no posture changes."""
    origin = move.origin
    while origin is not None and moves[origin].problem is not None:
        origin = moves[origin].origin if moves[origin].name in ("movel", "movep", "movec") else None
    return origin or ELSEWHERE


def _fill_literal(moves: list[Move], sites: Array, q: Array, pose: Array, settings: Mapping[str, Array]) -> None:
    """Moves of one shape whose arguments are plain numbers."""
    plain = literal(moves[0].statement.shape)
    assert plain is not None
    slots = [move.line.slots for move in moves]

    def numbers(slot: int, sign: float) -> Array:
        return sign * np.array([each[slot] for each in slots], dtype=float)

    for which, (target, is_pose) in enumerate(zip(plain.targets, plain.is_pose, strict=True)):
        (pose if is_pose else q)[sites + which] = np.stack([numbers(*each) for each in target], axis=1)
    for name in SETTINGS:
        if name in plain.settings:
            for which in range(len(plain.targets)):
                settings[name][sites + which] = numbers(*plain.settings[name])


def _require_sense(q: Array, pose: Array, line: Array, file: str) -> None:
    largest = np.nanmax(np.abs(np.concatenate([q, pose], axis=1)), axis=1, initial=0.0)
    wrong = ~(largest < FARTHEST_M)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(
            "a target far from any robot",
            file=file,
            line=int(line[k]),
            expected=f"numbers below {FARTHEST_M:g}, in m and rad",
            found=f"{largest[k]:g}",
        )
