"""Where a small motion can act in the chain from tracker to probe, and what it does to a reading.

A cause of error turns a joint, tilts an axis, moves the base or the probe, or stretches lengths. Seen from the
probe each of these is a small displacement, linear in the size of the motion:

    p_ME moves by R_MC v + R_MC w x (p_ME - p_MC), the probe turns by R_MC w

for a twist (v, w) of whatever is carried by frame C, expressed in C (Murray, Li, Sastry 1994, ch. 3). For motions
of a millimetre and a milliradian what this leaves out is below a micrometre.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from truepath import poe
from truepath.lie import Array
from truepath.robot import NominalRobot


class Moves(str, Enum):
    """What a cause moves; the value is the name in files."""

    JOINT = "joint"
    AXIS = "axis"
    BASE = "base"
    PROBE = "probe"
    ROBOT_LENGTHS = "robot lengths"
    MEASURED_LENGTHS = "measured lengths"
    READING = "reading"
    BEAM = "beam"


COMPONENTS: dict[Moves, tuple[str, ...]] = {
    Moves.JOINT: ("angle",),  # of a joint beyond its command, rad
    Moves.AXIS: ("x", "y", "z", "rx", "ry"),  # of what an axis carries, in the frame of the axis, m and rad
    Moves.BASE: ("x", "y", "z", "rx", "ry", "rz"),  # of the robot's base, in B
    Moves.PROBE: ("x", "y", "z", "rx", "ry", "rz"),  # of the probe, along and about the axes of the flange
    Moves.ROBOT_LENGTHS: ("strain",),  # all lengths between base and flange, by a common share
    Moves.MEASURED_LENGTHS: ("strain",),  # all lengths that the tracker reports
    Moves.READING: ("x", "y", "z"),  # of the reported position, in M, m
    Moves.BEAM: ("distance", "azimuth", "elevation"),  # of the same, m along the beam and rad across
}
OF_ONE_JOINT = (Moves.JOINT, Moves.AXIS)
BEFORE_THE_FLANGE = (Moves.AXIS, Moves.ROBOT_LENGTHS)  # joints apart, which enter the kinematics exactly

AROUND_THE_ROBOT = (Moves.BASE, Moves.PROBE, Moves.MEASURED_LENGTHS, Moves.READING, Moves.BEAM)


@dataclass(frozen=True, eq=False)
class ChainPoses:
    """Where everything is, for N poses. M measurement frame, B base, Ai axis i before its joint turns, F, E.

    Attributes:
        X_MB: ``(4, 4)``.
        X_MA: ``(N, n, 4, 4)``.
        X_MF, X_ME: ``(N, 4, 4)``.
    """

    X_MB: Array
    X_MA: Array
    X_MF: Array
    X_ME: Array
    _known: dict[tuple[Moves, int | None], Array] = field(default_factory=dict)

    @classmethod
    def of(cls, robot: NominalRobot, p: Array, phi_rad: Array, X_MB: Array, X_FE: Array) -> ChainPoses:
        """For deviations p as in ``poe`` and true joint angles ``(N, n)``."""
        X_BA, X_BF = poe.axis_and_flange_poses(robot, p, phi_rad)
        X_MF = X_MB @ X_BF
        return cls(X_MB, X_MB @ X_BA, X_MF, X_MF @ X_FE)

    def displacement(self, moves: Moves, joint: int | None = None) -> Array:
        """``(N, 6, c)`` shift of the probe, m, and its turn, rad, in M, per unit of each component of a motion."""
        if (moves, joint) not in self._known:
            self._known[moves, joint] = self._displacement(moves, joint)
        return self._known[moves, joint]

    def subset(self, rows: Array) -> ChainPoses:
        """The poses picked by an index or boolean array."""
        return ChainPoses(self.X_MB, self.X_MA[rows], self.X_MF[rows], self.X_ME[rows])

    def _displacement(self, moves: Moves, joint: int | None) -> Array:
        if moves in OF_ONE_JOINT:
            assert joint is not None
            X = self.X_MA[:, joint - 1]
            return self._twist(X, slice(5, 6) if moves is Moves.JOINT else slice(0, 5))
        if moves is Moves.BASE:
            return self._twist(np.broadcast_to(self.X_MB, self.X_ME.shape), slice(0, 6))
        if moves is Moves.PROBE:
            X = self.X_MF.copy()
            X[:, :3, 3] = self.X_ME[:, :3, 3]
            return self._twist(X, slice(0, 6))
        if moves is Moves.READING:
            return np.broadcast_to(np.eye(6, 3), (len(self.X_ME), 6, 3))
        if moves is Moves.BEAM:
            return self._polar()
        out = np.zeros((len(self.X_ME), 6, 1))
        from_base = self.X_MF[:, :3, 3] - self.X_MB[:3, 3]
        out[:, :3, 0] = from_base if moves is Moves.ROBOT_LENGTHS else self.X_ME[:, :3, 3]
        return out

    def _polar(self) -> Array:
        p = self.X_ME[:, :3, 3]
        out = np.zeros((len(p), 6, 3))
        level = np.maximum(np.hypot(p[:, 0], p[:, 1]), 1e-9)
        out[:, :3, 0] = p / np.maximum(np.linalg.norm(p, axis=1, keepdims=True), 1e-9)
        out[:, 0, 1], out[:, 1, 1] = -p[:, 1], p[:, 0]
        out[:, :2, 2] = -p[:, :2] * (p[:, 2] / level)[:, None]
        out[:, 2, 2] = level
        return out

    def _twist(self, X_MC: Array, components: slice) -> Array:
        R = X_MC[:, :3, :3]
        lever = self.X_ME[:, :3, 3] - X_MC[:, :3, 3]
        out = np.zeros((len(R), 6, 6))
        out[:, :3, :3] = out[:, 3:, 3:] = R
        # Column k of the rotation crossed with the lever.
        out[:, :3, 3:] = np.swapaxes(np.cross(np.swapaxes(R, 1, 2), lever[:, None, :]), 1, 2)
        return out[:, :, components]
