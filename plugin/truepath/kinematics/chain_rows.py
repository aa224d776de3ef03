"""The chain of frames from base to flange, for rows of poses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from truepath import poe
from truepath.lie import Array
from truepath.robot import NominalRobot

ROUNDING = 1e-15  # what a drawing with right angles leaves where a zero is meant


class ChainRows:
    """An arm whose every link is a shift, a tilt about x, and turns about z that join those of the joints beside it.

    Any rotation is Rz(a) Rx(b) Rz(c), so that of a link only Rx(b) and the shift are left to be done for each pose.

    Args:
        robot: nominal robot.
        p: deviations as in ``poe``.
        N: poses.

    Attributes:
        offset: ``(n,)`` what is added to the joint angles, rad.
        turn: ``(n,)`` by which each axis frame is turned about its z to be the frame that is used here, rad.
        axes, origins: ``(n, 3, N)`` direction of each joint axis and a point on it, in B.
        frame: ``(4, 3, N)`` columns of the flange's rotation, and its origin, in B.
        tilt, sway: ``(3, N)``: a point r of the flange moves by ``sway + tilt x r`` where axes move what they carry.
    """

    def __init__(self, robot: NominalRobot, p: Array, N: int) -> None:
        links = poe.link_transforms(poe.calibrated_axes(robot, p), robot.X_BF)
        a, b, c = np.array([_turn_tilt_turn(link[:3, :3]) for link in links]).T
        self.offset, self.turn = c[:-1] + a[1:], -c[:-1]
        self._tilts = [(_clean(np.cos(angle)), _clean(np.sin(angle))) for angle in b]
        shifts = [_about_z(-angle) @ link[:3, 3] for angle, link in zip(a, links, strict=True)]
        self._shifts = [[_clean(length) for length in shift] for shift in shifts]
        self._start, self._start_origin = _about_z(a[0]) @ _about_x(b[0]), links[0, :3, 3]
        self._last = _clean(np.cos(c[-1])), _clean(np.sin(c[-1]))
        n = robot.num_joints
        self.axes, self.origins, self.frame = np.empty((n, 3, N)), np.empty((n, 3, N)), np.empty((4, 3, N))
        self.tilt, self.sway = np.empty((3, N)), np.empty((3, N))
        self._scratch = np.empty((4, 3, N))

    def __call__(self, waves: Array, moves: Sequence[int] = (), motions: Array | None = None) -> None:
        """Poses of rows of joint angles.

        Args:
            waves: ``(2, n, N)`` sines and cosines of the angles plus ``offset``.
            moves: numbers from 0 of the axes that move what they carry.
            motions: ``(n, 6, N)`` by how much, as ``EffectRows`` has it.
        """
        t, u, v, w = self._scratch
        sin, cos = waves
        n, frame = len(sin), self.frame
        self.axes[0], self.origins[0] = self._start[:, 2, None], self._start_origin[:, None]
        X, Y = self._start[:, 0, None], self._start[:, 1, None]
        if moves:
            self.tilt[...], self.sway[...] = 0.0, 0.0
        for i in range(n):
            Z, P = self.axes[i], self.origins[i]
            if motions is not None and i in moves:
                self._carry(X, Y, Z, P, motions[i, 1:])
            # About z: X' = c X + s Y, Y' = c Y - s X.
            np.multiply(X, cos[i], t)
            np.multiply(Y, sin[i], u)
            np.multiply(Y, cos[i], w)
            np.multiply(X, sin[i], v)  # where Y may have been
            X, Y = np.add(t, u, frame[0]), np.subtract(w, v, frame[1])
            next_axis, next_origin = (self.axes[i + 1], self.origins[i + 1]) if i + 1 < n else (frame[2], frame[3])
            for column, length in zip((X, Y, Z), self._shifts[i + 1], strict=True):
                if length != 0.0:
                    P = np.add(P, np.multiply(column, length, t), next_origin)
            if P is not next_origin:
                next_origin[...] = P
            # About x: Z' = c Z - s Y, Y' = c Y + s Z.
            c, s = self._tilts[i + 1]
            turned = _combined(c, Z, -s, Y, next_axis, u)
            if turned is not next_axis:
                next_axis[...] = turned
            Y = _combined(c, Y, s, Z, v, w)
        c, s = self._last
        X, Y = _combined(c, X, s, Y, t, u), _combined(c, Y, -s, X, w, u)
        frame[0], frame[1] = X, Y

    def _carry(self, X: Array, Y: Array, Z: Array, P: Array, motion: Array) -> None:
        """Adds what the motion of one axis does: its turn w about, and its shift of, a point P on it."""
        x, y, z, rx, ry = motion
        t, u, _, w = self._scratch  # the third may hold Y
        for column, length in ((X, x), (Y, y), (Z, z)):
            self.sway += np.multiply(column, length, t)
        np.multiply(X, rx, w)
        w += np.multiply(Y, ry, t)
        self.tilt += w
        self.sway += cross(P, w, t, u)


def _combined(a: float, A: Array, b: float, B: Array, out: Array, scratch: Array) -> Array:
    """a A + b B: one of them where that is all that is left, else in ``out``."""
    if b == 0.0 or a == 0.0:
        one, factor = (A, a) if b == 0.0 else (B, b)
        return one if factor == 1.0 else np.multiply(one, factor, out)
    return np.add(np.multiply(A, a, out), np.multiply(B, b, scratch), out)


def cross(a: Array, b: Array, out: Array, scratch: Array) -> Array:
    """Cross products of rows ``(3, ..., N)``."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.multiply(a[i], b[j], out[k])
        np.multiply(a[j], b[i], scratch[k])
    return np.subtract(out, scratch, out)


def _turn_tilt_turn(R: Array) -> tuple[float, float, float]:
    """Angles (a, b, c) with R = Rz(a) Rx(b) Rz(c)."""
    b = np.arctan2(np.hypot(R[0, 2], R[1, 2]), R[2, 2])
    a = np.arctan2(R[0, 2], -R[1, 2]) if b > ROUNDING else 0.0  # without a tilt only a + c matters
    # What is left is a turn about z, whatever the rounding of a.
    left = _about_x(-b) @ _about_z(-a) @ R
    return float(a), float(b), float(np.arctan2(left[1, 0], left[0, 0]))


def _clean(value: float) -> float:
    rounded = float(np.round(value))
    return rounded if rounded in (-1.0, 0.0, 1.0) and abs(value - rounded) < ROUNDING else float(value)


def _about_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _about_x(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
