"""Where the joints may be while a program runs: near the way that its rehearsal has taken.

Frames: C the controller's base, 0 its tool flange, T tool.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from truepath import lie
from truepath.controller import Controller
from truepath.deploying.passages import ZONE_RAD_PER_M_OF_BLEND
from truepath.deploying.rehearsal import Rehearsal
from truepath.lie import Array
from truepath.postures import follow_targets
from truepath.programs.motions import Kind
from truepath.rewriting.arcs import arc_through

MARGIN_RAD = math.radians(
    5.0
)  # for what the rehearsal leaves out: how a controller rounds corners, lag, other firmware
STEP_RAD, MOST_POINTS = math.radians(1.0), 1_000_000  # between points of the way
SPACING_M, SPACING_RAD, MOST_SAMPLES, ARC_SAMPLES = 0.02, 0.1, 64, 24  # of the tool's way, for its joints


@dataclass(frozen=True, eq=False)
class RehearsedWay:
    """All of it, without its times.

    Attributes:
        tree: points of the way, joints ``(M, 6)``.
        allowed_rad: ``(M,)`` how far any joint may be from such a point: more where corners are rounded.
        targets: how many there are on it; when they are passed and the program goes on, nobody knows where.
        ends: the program does not go on.
    """

    tree: cKDTree
    allowed_rad: Array
    targets: int
    ends: bool

    def holds(self, passed: int) -> bool:
        """Whether the robot must be on the way when it has passed so many targets."""
        return self.ends or passed < self.targets

    def strayed(self, q_rad: Array) -> str | None:
        """The first of joints ``(B, 6)`` that are too far from the way, in words; None if there are none."""
        away, nearest = self.tree.query(q_rad, p=np.inf)
        beyond = away > self.allowed_rad[nearest]
        if not beyond.any():
            return None
        first = int(np.argmax(beyond))
        joint = int(np.argmax(np.abs(q_rad[first] - self.tree.data[nearest[first]])))
        return (
            f"the robot has left the way that its program takes when run through beforehand: joint {joint + 1} is "
            f"{math.degrees(away[first]):.1f} deg from it"
        )


def rehearsed_way(rehearsal: Rehearsal, controller: Controller, q_start_rad: Array) -> RehearsedWay:
    """The way over all targets.

    Args:
        rehearsal: with ``N`` targets.
        controller: what it believes; by it lines and arcs of the tool become joints.
        q_start_rad: ``(6,)`` where the robot stands.
    """
    start = np.vstack([q_start_rad, rehearsal.q_rad])[:-1]
    leg, share, q = _knots_of_tools_ways(rehearsal, controller, start)
    count = np.arange(len(rehearsal))
    leg = np.concatenate([count, count, leg])
    share = np.concatenate([0.0 * count, 0.0 * count + 1.0, share])
    order = np.lexsort([share, leg])
    leg, q = leg[order], np.vstack([start, rehearsal.q_rad, q])[order]
    points, leg = _filled(np.vstack([q_start_rad, q]), np.append(0, leg))
    return RehearsedWay(cKDTree(points), _allowed(rehearsal, start)[leg], len(rehearsal), rehearsal.open_end is None)


def _knots_of_tools_ways(rehearsal: Rehearsal, controller: Controller, start: Array) -> tuple[Array, Array, Array]:
    """Leg ``(S,)``, share of it ``(S,)`` and joints ``(S, 6)`` of points between targets, where the tool is led."""
    legs = np.flatnonzero(~np.isin(rehearsal.kind, (Kind.JOINT, Kind.SERVO)))
    X_0T = rehearsal.X_0T[legs]
    X_start = controller.tool_poses(start[legs], X_0T)
    X_goal = controller.tool_poses(rehearsal.q_rad[legs], X_0T)
    turn = lie.rotation_vector(lie.invert(X_start)[:, :3, :3] @ X_goal[:, :3, :3])
    shift = X_goal[:, :3, 3] - X_start[:, :3, 3]
    spaces = np.maximum(np.linalg.norm(shift, axis=1) / SPACING_M, np.linalg.norm(turn, axis=1) / SPACING_RAD)
    counts = np.clip(np.ceil(spaces).astype(int), 1, MOST_SAMPLES)
    arcs = np.flatnonzero(rehearsal.kind[legs] == Kind.ARC)
    counts[arcs] = ARC_SAMPLES
    first = np.concatenate([[0], np.cumsum(counts)])
    of = np.repeat(np.arange(len(legs)), counts)
    share = (np.arange(first[-1]) - first[of]) / counts[of]
    position = X_start[of, :3, 3] + share[:, None] * shift[of]
    for each in arcs:
        part = slice(first[each], first[each + 1])
        arc = arc_through(X_start[each, :3, 3], rehearsal.p_via[legs[each]], X_goal[each, :3, 3])
        if arc is not None:
            position[part] = arc.points(share[part])
            if rehearsal.turns_along[legs[each]]:
                turn[each] = X_start[each, :3, :3].T @ (arc.angle_rad * arc.circle.axis)
    rotation = X_start[of, :3, :3] @ lie.from_rotation_vector(share[:, None] * turn[of])
    X_C0 = lie.make_pose(rotation, position) @ lie.invert(X_0T)[of]
    begins = share == 0.0
    stated = np.where(begins[:, None], start[legs][of], np.nan)
    previous = np.where(begins, -1, np.arange(len(of)) - 1)
    nothing = np.full_like(stated, np.nan)
    found = follow_targets(controller, X_C0, stated, nothing, previous, is_straight=~begins)
    between = found.reached & ~begins
    return legs[of][between], share[between], found.q_rad[between]


def _filled(q: Array, leg: Array) -> tuple[Array, Array]:
    """Points ``(M, 6)`` on the straight ways between joints ``(K, 6)``, the last included, and their legs ``(M,)``."""
    step = np.diff(q, axis=0)
    length = np.abs(step).max(axis=1, initial=0.0)
    counts = np.maximum(np.ceil(length / max(STEP_RAD, length.sum() / MOST_POINTS)).astype(int), 1)
    of = np.repeat(np.arange(len(step)), counts)
    share = (np.arange(counts.sum()) - (np.cumsum(counts) - counts)[of]) / counts[of]
    points = q[of] + share[:, None] * step[of]
    return np.vstack([points, q[-1]]), np.append(leg[1:][of], leg[-1])


def _allowed(rehearsal: Rehearsal, start: Array) -> Array:
    """``(N + 1,)`` how far the joints may be from the way to each target, and from where they are if there is none."""
    blend_m = np.maximum(rehearsal.blend_m, np.append(0.0, rehearsal.blend_m)[:-1])
    # A controller that is fed with joints smooths them, the more the further they are apart.
    fed = np.where(rehearsal.kind == Kind.SERVO, np.abs(rehearsal.q_rad - start).max(axis=1, initial=0.0), 0.0)
    return np.append(MARGIN_RAD + ZONE_RAD_PER_M_OF_BLEND * blend_m + fed, MARGIN_RAD)
