"""The joints at all targets of a program, wherever the robot may come from."""

from __future__ import annotations

import numpy as np

from truepath.lie import Array
from truepath.postures import FollowedTargets, follow_targets
from truepath.programs.motions import Kind, Motions
from truepath.robot import NominalRobot

BY_TOOL = (Kind.LINEAR, Kind.PROCESS, Kind.THROUGH, Kind.ARC)
SAME_RAD = 1e-6


def known_postures(robot: NominalRobot, motions: Motions, X_BF: Array, q_near_rad: Array) -> FollowedTargets:
    """Follows the targets by their origins; what another way to a target contradicts is not known.

    A pose in a function that is called twice, or first in a loop, is reached from several places. Only if it is the
    same joints from all of them can one correction be right.

    Args:
        X_BF: ``(N, 4, 4)`` flange poses.
        q_near_rad: ``(N, n)`` joints near which poses are to be reached, NaN where not stated.
    """
    # The posture stays what it was while the tool goes along a line or an arc.
    by_tool = np.isin(motions.kind, BY_TOOL) & np.isnan(q_near_rad[:, 0])
    origin = motions.origin.copy()
    to = motions.possible[:, 1]
    ways = motions.possible[motions.is_pose[to] & np.isnan(q_near_rad[to, 0])]
    while True:
        followed = follow_targets(robot, X_BF, motions.q_rad, q_near_rad, origin, is_straight=by_tool)
        known = followed.certain & followed.reached
        looked_at = ways[origin[ways[:, 1]] >= 0]
        differs = ~known[looked_at[:, 0]]
        from_there = np.flatnonzero(~differs)
        if len(from_there):
            differs[from_there] = _differ(robot, motions, X_BF, by_tool, followed.q_rad, looked_at[from_there])
        contradicted = np.unique(looked_at[differs, 1])
        if not len(contradicted):
            return followed
        origin[contradicted] = -1  # what follows from these is not known either: once more


def _differ(robot: NominalRobot, motions: Motions, X_BF: Array, by_tool: Array, q_rad: Array, ways: Array) -> Array:
    """``(P,)`` True where the joints at the end of a way ``(P, 2)`` are others than those that were found there."""
    start, end = ways.T
    count = len(ways)
    nothing = np.full_like(q_rad[end], np.nan)
    again = follow_targets(
        robot,
        np.concatenate([X_BF[start], X_BF[end]]),
        np.concatenate([q_rad[start], nothing]),
        np.concatenate([nothing, nothing]),
        np.concatenate([np.full(count, -1), np.arange(count)]),
        is_straight=np.concatenate([np.zeros(count, bool), by_tool[end]]),
    )
    same = np.abs(again.q_rad[count:] - q_rad[end]).max(axis=1) < SAME_RAD  # never for NaN
    return ~(same & again.certain[count:])
