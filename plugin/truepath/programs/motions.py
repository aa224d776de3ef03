"""A program as its motions: what every format is parsed into and rewritten from. Knows nothing of calibration."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from truepath.lie import Array


class Kind(IntEnum):
    """How the tool gets to a target, and what the target is for."""

    JOINT = 0  # all joints in step, as movej
    LINEAR = 1  # the tool along a straight line, as movel
    PROCESS = 2  # a line at constant speed, as movep
    THROUGH = 3  # a point that the arc to the next target passes, the first target of a movec
    ARC = 4  # the end of that arc
    SERVO = 5  # joints at a fixed rate, as servoj


STRAIGHT = (Kind.LINEAR, Kind.PROCESS)


@dataclass(frozen=True, eq=False)
class Motions:
    """N targets in the order in which they are written. Frames: C controller's base, 0 its tool flange, T tool.

    A target is joints or a pose; the other one is NaN. What the program does not state is NaN too.

    Attributes:
        kind: ``(N,)`` a ``Kind`` each.
        q_rad: ``(N, n)`` joints.
        X_CT: ``(N, 4, 4)`` tool poses.
        q_near_rad: ``(N, n)`` joints near which a pose is to be reached.
        tools: ``(K, 4, 4)`` X_0T, every tool that the program sets; the first one holds from the start.
        tool: ``(N,)`` index of the tool in force.
        line: ``(N,)`` where the target is written, from 1.
        previous: ``(N,)`` index of the target from which the robot comes; -1 where that is not known: at the
            start, or where several lead here.
        origin: ``(N,)`` index of one of the targets from which the robot can come, or came before a motion along a
            line that cannot be resolved; -1 if there is none.
        starts: ``(N,)`` True where the program can come from its start.
        speed, acceleration: ``(N,)`` of the tool in m/s and m/s^2, for JOINT of the leading joint in rad/s and rad/s^2.
        time_s: ``(N,)`` stated for the motion, instead of its speed.
        blend_m: ``(N,)`` radius.
        rotation_vector: ``(N, 3)`` of poses as written, rad; not the shortest one perhaps. None if nobody knows.
        possible: ``(P, 2)`` from where and to where the robot can go, for targets to which several motions lead.
    """

    kind: Array
    q_rad: Array
    X_CT: Array
    q_near_rad: Array
    tools: Array
    tool: Array
    line: Array
    previous: Array
    origin: Array
    starts: Array
    speed: Array
    acceleration: Array
    time_s: Array
    blend_m: Array
    rotation_vector: Array | None = None
    possible: Array = field(default_factory=lambda: np.empty((0, 2), int))

    def __len__(self) -> int:
        return len(self.kind)

    @property
    def is_pose(self) -> Array:
        """``(N,)`` True where the target is a pose."""
        return np.isnan(self.q_rad[:, 0])

    @property
    def is_straight(self) -> Array:
        """``(N,)`` True where the tool comes along a straight line."""
        return np.isin(self.kind, STRAIGHT)

    @property
    def X_0T(self) -> Array:
        """``(N, 4, 4)`` tool in force at each target."""
        return self.tools[self.tool]


def joint_path(q_rad: Array, tools: Array, line: Array) -> Motions:
    """Joints ``(N, n)`` one after the other, nothing else stated; ``tools`` ``(1, 4, 4)`` and ``line`` ``(N,)``."""
    count = len(q_rad)
    nothing, before = np.full(count, np.nan), np.arange(count) - 1
    return Motions(
        kind=np.full(count, int(Kind.JOINT)),
        q_rad=q_rad,
        X_CT=np.full((count, 4, 4), np.nan),
        q_near_rad=np.full_like(q_rad, np.nan),
        tools=tools,
        tool=np.zeros(count, int),
        line=line,
        previous=before,
        origin=before,
        starts=before < 0,
        speed=nothing,
        acceleration=nothing,
        time_s=nothing,
        blend_m=nothing,
    )
