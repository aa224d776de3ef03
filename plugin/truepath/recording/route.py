"""Which way to a pose of the list: along the list, whose ways from row to row are those that were looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath.lie import Array

ON_THE_WAY_RAD = 0.01
SAME_PLACE_RAD = 1e-3


@dataclass(frozen=True)
class Route:
    """How to come to a row of the list.

    Attributes:
        rows: to be driven to one after the other; the last is the goal.
        known: whether the robot stands on a way of the list; otherwise the first move goes where nobody has looked.
    """

    rows: tuple[int, ...]
    known: bool


def route(q_rad: Array, q_now_rad: Array, goal: int) -> Route:
    """From where the robot stands ``(n,)`` to row ``goal`` of ``(N, n)`` joints.

    The goal is reached from the row before it, as the list has it: with play in the gears it matters from which side.
    """
    if np.abs(q_now_rad - q_rad[goal]).max() < SAME_PLACE_RAD:
        return Route(_away_and_back(q_rad, goal), True)
    found = _leg(q_rad, q_now_rad, goal)
    if found is None:
        return Route(tuple(range(_row_before(q_rad, goal), goal + 1)), False)
    if found >= goal:
        return Route((found, *back_and_forth(q_rad, found, goal)) if found else (0,), True)
    return Route(tuple(range(found + 1, goal + 1)), True)


def _away_and_back(q_rad: Array, goal: int) -> tuple[int, ...]:
    """From the goal to the row before it, or after it if there is none, and to it again.

    From which side the robot had come nobody knows any more.
    """
    elsewhere = np.flatnonzero(np.abs(q_rad - q_rad[goal]).max(axis=1) >= SAME_PLACE_RAD)
    if not len(elsewhere) or elsewhere[0] < goal:
        return back_and_forth(q_rad, goal, goal)
    after = int(elsewhere[0])
    return (*range(goal + 1, after), *range(after, goal - 1, -1))


def back_and_forth(q_rad: Array, row: int, goal: int) -> tuple[int, ...]:
    """From row ``row``, where the robot stands, to a goal not after it: back beyond the goal, then forward to it."""
    before = _row_before(q_rad, goal)
    return (*range(row - 1, before, -1), *range(before, goal + 1))


def _row_before(q_rad: Array, goal: int) -> int:
    """The last row before the goal that is another place; the first row if there is none."""
    elsewhere = np.flatnonzero(np.abs(q_rad[:goal] - q_rad[goal]).max(axis=1) >= SAME_PLACE_RAD)
    return int(elsewhere[-1]) if len(elsewhere) else 0


def _leg(q_rad: Array, q_now_rad: Array, goal: int) -> int | None:
    """The row from which the way leads on which the robot stands; of several the best for the goal."""
    begin = q_rad
    end = np.concatenate([q_rad[1:], q_rad[-1:]])
    along = end - begin
    length2 = np.maximum(np.einsum("ki,ki->k", along, along), 1e-30)
    share = np.clip(np.einsum("ki,ki->k", q_now_rad - begin, along) / length2, 0.0, 1.0)
    off = np.abs(q_now_rad - begin - share[:, None] * along).max(axis=1)
    legs = np.flatnonzero(off < ON_THE_WAY_RAD)
    if not len(legs):
        return None
    return int(legs[np.argmin(np.abs(legs - (goal - 1)))])
