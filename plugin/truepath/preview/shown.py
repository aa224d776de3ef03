"""What a preview is of: the rows of a path, which of them are waypoints, where they are written, what is amiss."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from truepath import lie
from truepath.errors import InputError
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.programs.motions import Kind
from truepath.region import Region
from truepath.rewriting.plan import tool_poses_meant

if TYPE_CHECKING:
    from truepath.controller import Controller
    from truepath.rewriting.rewrite import RewrittenProgram

LONGEST_LABEL = 160
MOST_STRETCHES = 20
SAME_TOOL = 1e-9
A_TOOL_M = 1e-6  # a tool that is shorter than this is none


@dataclass(frozen=True)
class Remark:
    """Something to look at, and the waypoint where it is (counted from 0); None where it is about all."""

    text: str
    waypoint: int | None


@dataclass(frozen=True, eq=False)
class HostTool:
    """The tool of a host, whose paths are shown where the path itself states none.

    Attributes:
        X_FT: ``(4, 4)`` where it is mounted on the flange, as drawn.
        name: in words.
    """

    X_FT: Array
    name: str

    def as_it_is(self, model: CalibratedModel) -> Array:
        """``(4, 4)`` where it is on the real flange: what that is known to be off, the tool is too."""
        return lie.invert(model.goal_frames()[1]) @ self.X_FT


@dataclass(frozen=True, eq=False)
class ShownPath:
    """N rows of joints of which T are waypoints; the others lie on the ways between.

    Attributes:
        q_meant: ``(N, n)`` what they reach in nominal kinematics is what the program means, rad.
        q_today: ``(N, n)`` where the robot is sent today.
        q_corrected: ``(N, n)`` where it is sent with the correction.
        joined: ``(N,)`` True where the robot comes from the row before on a known way, joints in step.
        waypoint: ``(T,)`` rows of the waypoints.
        line: ``(T,)`` where they are written, from 1; None: nowhere.
        labels: T texts; empty for none.
        X_FT: ``(4, 4)`` the tool whose paths are shown, in the flange; None: the one of the calibration.
        remarks: what the guards say.
        looked_in: the cell in which collisions were looked for; None: nowhere.
    """

    q_meant: Array
    q_today: Array
    q_corrected: Array
    joined: Array
    waypoint: Array
    line: Array | None = None
    labels: tuple[str, ...] = ()
    X_FT: Array | None = None
    remarks: tuple[Remark, ...] = ()
    looked_in: str | None = None

    @classmethod
    def of_joints(cls, q_programmed: Array, q_corrected: Array, labels: Sequence[str] | None = None) -> ShownPath:
        """Every row is a waypoint, reached from the one before; today the robot is sent where the program says."""
        N = len(q_programmed)
        texts = tuple(_short(str(label)) for label in labels or ())
        return cls(q_programmed, q_programmed, q_corrected, np.arange(N) > 0, np.arange(N), labels=texts)

    @classmethod
    def of_program(cls, rewritten: RewrittenProgram, controller: Controller, text: str | None = None) -> ShownPath:
        """All targets of a program, points that arcs pass among them, and samples of lines and arcs between them.

        Args:
            rewritten: the program, with at least one target.
            controller: of the robot.
            text: of the program, whose lines are shown; None: only their numbers are.
        """
        plan, ways, motions = rewritten.plan, rewritten.ways, rewritten.plan.motions
        followed = ways.followed[np.repeat(np.arange(len(ways.target)), np.diff(ways.first))]
        way = np.repeat(np.arange(len(ways.target)), np.diff(ways.first))[followed]
        share = ways.share[followed][:, None]
        start_of = np.where(np.isin(motions.kind, (Kind.JOINT, Kind.SERVO)), motions.previous, -1)
        start_of[ways.target[ways.followed]] = ways.start[ways.followed]

        # On the way the controller is off the nominal kinematics by nearly what it is off at both ends.
        off = plan.q_today_rad - plan.q_rad
        off_on_way = (1.0 - share) * off[ways.start[way]] + share * off[ways.target[way]]
        q_way = ways.q_rad[followed]
        place, belongs_to = _places(rewritten, controller)
        order = np.concatenate([place, ways.target[way] - 1.0 + share[:, 0]])
        sequence = np.argsort(order, kind="stable")
        of = np.concatenate([belongs_to, ways.target[way]])[sequence]
        waypoint = np.flatnonzero(sequence < len(motions))
        row_of = np.full(len(motions) + 1, -2)  # the last one is that of "not known"
        row_of[:-1] = waypoint
        first = np.diff(of, prepend=-1) != 0
        joined = ~first | (row_of[start_of[of]] == np.arange(len(of)) - 1)
        q_meant, q_today, q_corrected = (
            np.concatenate(parts)[sequence]
            for parts in (
                (plan.q_rad, q_way),
                (plan.q_today_rad, q_way + off_on_way),
                (rewritten.correction.q_rad, ways.q_corrected_rad[followed]),
            )
        )
        line = motions.line.astype(int)
        written = [] if text is None else text.splitlines()
        labels = tuple(_short(written[k - 1].strip()) if k <= len(written) else "" for k in line.tolist())
        return cls(
            q_meant,
            q_today,
            q_corrected,
            joined & (np.arange(len(of)) > 0),
            waypoint,
            line,
            labels if written else (),
            _only_tool(controller.X_F0 @ motions.X_0T),
            _remarks(rewritten, line),
            rewritten.cell,
        )

    def outside(self, region: Region) -> Array:
        """``(N,)`` True where the calibration data did not reach."""
        return np.logical_not(region.contains(self.q_meant))

    def stretches_outside(self, region: Region) -> tuple[Remark, ...]:
        """Where waypoints lie outside the calibrated region, the longest stretches."""
        outside = self.outside(region)[self.waypoint]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], outside.astype(int), [0]])))
        found = list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))
        longest = sorted(sorted(found, key=lambda ends: ends[0] - ends[1])[:MOST_STRETCHES])
        return tuple(
            Remark(f"outside the calibrated region: {_from_to('waypoint', first + 1, last + 1)}", first)
            for first, last in longest
        )


def require_joints(q_programmed: Array, q_corrected: Array, num_joints: int) -> None:
    """Raises ``InputError`` unless both are ``(N, n)`` numbers of the robot, N being one or more."""
    for name, q in (("programmed", q_programmed), ("corrected", q_corrected)):
        if q.ndim != 2 or q.shape[1] != num_joints or len(q) == 0:
            raise InputError(
                f"the {name} joints cannot be shown",
                expected=f"one waypoint or more with {num_joints} joints each",
                found=f"an array of shape {q.shape}",
            )
        if not np.isfinite(q).all():
            row = int(np.argmin(np.isfinite(q).all(axis=1)))
            raise InputError(f"the {name} joints are no numbers at waypoint {row + 1}", found=str(q[row]))
    if len(q_programmed) != len(q_corrected):
        raise InputError(
            "programmed and corrected path differ in length",
            expected=str(len(q_programmed)),
            found=str(len(q_corrected)),
        )


def _places(rewritten: RewrittenProgram, controller: Controller) -> tuple[Array, Array]:
    """``(N,)`` where each target stands in the sequence, and ``(N,)`` on the way to which one.

    A target stands at its own number, but one that an arc passes stands on the way to that arc's end, as far along as
    it lies on the circle.
    """
    plan, ways = rewritten.plan, rewritten.ways
    place, belongs_to = np.arange(len(plan), dtype=float), np.arange(len(plan))
    p_CT = tool_poses_meant(plan, controller)[:, :3, 3]
    for way, arc in ways.arcs.items():
        if ways.followed[way]:
            end, away = int(ways.target[way]), p_CT[arc.through] - arc.circle.centre
            angle = np.arctan2(np.cross(arc.circle.axis, arc.radius) @ away, arc.radius @ away) % (2.0 * np.pi)
            place[arc.through], belongs_to[arc.through] = end - 1.0 + angle / arc.angle_rad, end
    return place, belongs_to


def _remarks(rewritten: RewrittenProgram, line: Array) -> tuple[Remark, ...]:
    """Each finding, worst level first and in the order of the lines, what the correction says, what stays as it is."""

    def waypoint(where: int | None) -> int | None:
        if where is None:
            return None
        there = np.flatnonzero(line == where)
        return int(there[0]) if len(there) else int(np.argmin(np.abs(line - where)))

    ordered = sorted(rewritten.findings, key=lambda each: (each.level, each.line or 0))
    found = [
        Remark(f"{each.guard}{'' if each.line is None else f', line {each.line}'}: {each.message}", waypoint(each.line))
        for each in ordered
    ]
    for sentence in rewritten.correction.warnings:
        place = re.search(r"in line (\d+)", sentence)
        found.append(Remark(sentence, waypoint(int(place[1]) if place else None)))
    found += [
        Remark(f"line {each.line} stays as it is: {each.why}", waypoint(each.line)) for each in rewritten.unresolved
    ]
    return tuple(found)


def _only_tool(X_FT: Array) -> Array | None:
    """The one of tools ``(T, 4, 4)`` if all are the same and there is one."""
    same = np.abs(X_FT - X_FT[0]).max() < SAME_TOOL
    return X_FT[0] if same and np.linalg.norm(X_FT[0, :3, 3]) > A_TOOL_M else None


def _short(text: str) -> str:
    return text if len(text) <= LONGEST_LABEL else text[: LONGEST_LABEL - 1] + "…"


def _from_to(noun: str, first: int, last: int) -> str:
    return f"{noun} {first}" if first == last else f"{noun}s {first} to {last}"
