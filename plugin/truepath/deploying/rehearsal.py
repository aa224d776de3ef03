"""A program run through without a robot: where it will go, with which tool and payload.

Frames: C the controller's base, 0 its tool flange, T tool.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truepath.controller import Controller, vectors_from_poses
from truepath.lie import Array
from truepath.postures import follow_targets
from truepath.programs.motions import Kind
from truepath.virtual.controller.script_instructions import Move, SetPayload, Six, SpeedJoints, Wait
from truepath.virtual.controller.script_runner import run_script
from truepath.virtual.controller.script_values import matrix

MOST_TARGETS, MOST_INSTRUCTIONS = 20_000, 200_000
NOWHERE = (np.nan,) * 3
MOST_TURNS = 50  # to the same joints in the same line: a loop that may well be endless


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """What a program does from certain joints on, as far as can be told.

    Attributes:
        line, kind, blend_m: ``(N,)`` of each target in the order of the run.
        q_rad: ``(N, 6)`` joints there, as the controller finds them.
        X_0T: ``(N, 4, 4)`` tool in force.
        is_pose: ``(N,)`` True where the program states a pose.
        p_via: ``(N, 3)`` point in C that an arc passes on its way to the target, m; NaN for all other ways.
        turns_along: ``(N,)`` True where the tool turns along with the arc.
        payloads: set by the program, in order.
        longest_wait_s: in one piece.
        open_end: why nobody knows what follows; None if this is all of it.
    """

    line: Array
    kind: Array
    blend_m: Array
    q_rad: Array
    X_0T: Array
    is_pose: Array
    p_via: Array
    turns_along: Array
    payloads: tuple[SetPayload, ...]
    longest_wait_s: float
    open_end: str | None

    def __len__(self) -> int:
        return len(self.line)

    @property
    def through(self) -> int:
        """How many points are passed on arcs, besides the targets at their ends."""
        return int((~np.isnan(self.p_via[:, 0])).sum())

    @property
    def depends_on_tool(self) -> bool:
        """Whether another tool on the controller would lead the arm elsewhere, or along other ways."""
        return bool((self.is_pose | ~np.isin(self.kind, (Kind.JOINT, Kind.SERVO))).any())


class BelievedKinematics:
    """A controller as the script runner wants it."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller

    def forward(self, q_rad: Array) -> Array:
        return self._controller.tool_poses(q_rad[None], np.eye(4))[0]

    def inverse(self, X_C0: Array, q_near_rad: Array) -> Array | None:
        nothing = np.full((1, 6), np.nan)
        found = follow_targets(self._controller, X_C0[None], nothing, q_near_rad[None], np.array([-1]))
        return found.q_rad[0] if found.reached[0] else None


class _NotKnown(Exception):  # noqa: N818 - what a sensor will say is no error
    pass


def rehearse(text: str, controller: Controller, q_start_rad: Array, tool: Sequence[float]) -> Rehearsal:
    """Runs through a program.

    Args:
        text: of the program.
        controller: what it believes.
        q_start_rad: ``(6,)`` joints from which it is started.
        tool: X_0T before the program sets one, ``(6,)``.

    Raises:
        ScriptError: the program does what no controller would do.
    """
    moves: list[Move] = []
    payloads: list[SetPayload] = []
    turns: Counter[tuple[int, Six]] = Counter()
    again, longest, open_end = 0, 0.0, None
    kinematics = BelievedKinematics(controller)

    def ask(name: str, arguments: tuple[Any, ...]) -> Any:
        now = np.array(moves[-1].q_rad if moves else q_start_rad)
        if name == "get_actual_joint_positions":
            return now
        if name == "get_actual_tcp_pose":
            X_0T = matrix(moves[-1].tool if moves else tool)
            return vectors_from_poses(kinematics.forward(now) @ X_0T)
        raise _NotKnown(f"what follows depends on {name}")

    try:
        for count, each in enumerate(run_script(text, q_start_rad.tolist(), kinematics, ask, tool=tool)):
            if isinstance(each, Move):
                moves.append(each)
                turns[each.line, each.q_rad] += 1
                again = turns[each.line, each.q_rad]
            elif isinstance(each, SetPayload):
                payloads.append(each)
            elif isinstance(each, SpeedJoints) and any(each.speed_rad_s):
                open_end = f"line {each.line} moves the joints by speed, to wherever they are then"
                break
            elif isinstance(each, Wait):
                longest = max(longest, each.time_s)
            if again >= MOST_TURNS or len(moves) >= MOST_TARGETS or count >= MOST_INSTRUCTIONS:
                open_end = "it goes on and on"
                break
    except _NotKnown as unknown:
        open_end = str(unknown)
    return Rehearsal(
        line=np.array([move.line for move in moves], int),
        kind=np.array([move.kind for move in moves], int),
        blend_m=np.array([move.blend_m for move in moves], float),
        q_rad=np.array([move.q_rad for move in moves], float).reshape(-1, 6),
        X_0T=np.array([matrix(move.tool) for move in moves]).reshape(-1, 4, 4),
        is_pose=np.array([move.stated_as_pose for move in moves], bool),
        p_via=np.array([NOWHERE if move.via is None else move.via[:3] for move in moves], float).reshape(-1, 3),
        turns_along=np.array([move.follows_orientation for move in moves], bool),
        payloads=tuple(payloads),
        longest_wait_s=longest,
        open_end=open_end,
    )
