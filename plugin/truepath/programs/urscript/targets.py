"""What was found in a program, as arrays."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from truepath.errors import InputError
from truepath.lie import Array, make_pose
from truepath.programs.motions import Kind, Motions
from truepath.programs.urscript.literals import Resolved
from truepath.programs.urscript.moves import MOVES, Move, Step, literal
from truepath.programs.urscript.rewrite import Site
from truepath.programs.urscript.state import ELSEWHERE, START
from truepath.programs.urscript.values import JointsOf, Pose, Value, is_number, matrix

SETTINGS = ("v", "a", "t", "r")
FARTHEST_M = 1000.0


def motions_of(
    resolved: list[Resolved], moves: Mapping[Step, Move], start: Pose, file: str
) -> tuple[Motions, tuple[Site, ...]]:
    """Targets as arrays, and where each is written.

    Raises:
        InputError: a target that no robot can reach.
    """
    tools: dict[Value, int] = {start: 0}
    sites: list[Site] = []
    last_site: dict[Step, int] = {}
    by_shape: dict[int, list[int]] = {}
    for number, each in enumerate(resolved):
        move = each.move
        if not move.targets:
            by_shape.setdefault(id(move.statement.shape), []).append(number)
        sites += [Site(move, which, each.literal) for which in range(len(MOVES[move.name].kinds))]
        for step in each.steps:
            last_site[step] = len(sites) - 1
    count = len(sites)
    first_site = np.array([last_site[each.steps[0]] - len(MOVES[each.move.name].kinds) + 1 for each in resolved], int)
    q, pose, near = (np.full((count, 6), np.nan) for _ in range(3))
    settings = {name: np.full(count, np.nan) for name in SETTINGS}
    for numbers in by_shape.values():
        _fill_literal([resolved[number].move for number in numbers], first_site[numbers], q, pose, settings)
    for at, (move, which, _) in enumerate(sites):
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
    columns = [_column(site, at, last_site, moves, tools) for at, site in enumerate(sites)]
    kind, line, tool, previous, origin, starts = np.array(columns, int).reshape(count, 6).T
    _require_sense(np.hstack([q, pose, near]), line, file)
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
        starts=starts.astype(bool),
        speed=settings["v"],
        acceleration=settings["a"],
        time_s=np.where(settings["t"] > 0, settings["t"], np.nan),  # zero: by speed and acceleration
        blend_m=np.where(kind == Kind.THROUGH, np.nan, settings["r"]),
        rotation_vector=pose[:, 3:],
        possible=_possible(sites, last_site),
    )
    return motions, tuple(sites)


def _column(
    site: Site, at: int, last_site: Mapping[Step, int], moves: Mapping[Step, Move], tools: dict[Value, int]
) -> tuple[int, int, int, int, int, bool]:
    """Kind, line, tool, previous, origin, starts of a target."""
    move, which, written = site
    kind = MOVES[move.name].kinds[which]
    line = move.statement.line.number if written is None else written.line.number
    tool = tools.get(move.tool, -1) if isinstance(move.tool, Pose) else 0
    if tool < 0:
        tool = tools.setdefault(move.tool, len(tools))
    if which:
        return kind, line, tool, at - 1, at - 1, False
    if move.origin is not None and len(move.previous) == 1:
        known = last_site.get(move.origin, -1)
        if known >= 0:
            return kind, line, tool, known, known, False
    before = {last_site.get(step, -1) for step in move.previous}
    previous = before.pop() if len(before) == 1 else -1
    return kind, line, tool, previous, last_site.get(_last_resolved(move, moves), -1), START in move.previous


def _possible(sites: list[Site], last_site: Mapping[Step, int]) -> Array:
    """``(P, 2)`` pairs of targets, for moves that several others lead to."""
    pairs = [
        (last_site[step], at)
        for at, (move, which, _) in enumerate(sites)
        if which == 0 and len(move.previous) > 1
        for step in sorted(move.previous)
        if step in last_site
    ]
    return np.array(pairs, int).reshape(-1, 2)


def _last_resolved(move: Move, moves: Mapping[Step, Move]) -> Step:
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


def _require_sense(numbers: Array, line: Array, file: str) -> None:
    largest = np.nanmax(np.abs(numbers), axis=1, initial=0.0)
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
