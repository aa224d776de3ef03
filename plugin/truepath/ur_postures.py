"""The eight postures in which an arm with three parallel axes reaches a pose, in closed form.

For six joints of which 2, 3 and 4 turn about parallel axes and 5 and 6 about axes that meet, as those of Universal
Robots do. With the screws at zero (product of exponentials), by subproblems as of Paden and Kahan:

    G = X_BF X_BF(0)^-1 = e1 e2 e3 e4 e5 e6,   h the direction of the parallel axes, P where axes 5 and 6 meet
    q1: nothing from joint 2 on moves P along h                     h . e1^-1 G P = h . P             2 solutions
    q5: joints 2, 3, 4 keep what axis 6 has along h                 h . e1^-1 G w6 = h . e5 w6        2 solutions
    q6: e6 turns the direction that G brings to h                   e6 (G^T e1 h) = e5^-1 h
    q3: how far axis 4 is from axis 2, in the plane across h; then q2, and q4 by the whole turn       2 solutions

Frames: L at axis 1 with z along h; P at the meeting point with z along axis 6; both fixed at zero, in B and on F.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath import lie
from truepath.lie import Array
from truepath.robot import NominalRobot

POSTURES = 8
PARALLEL_RAD, MEET_M = 0.05, 0.02  # calibrated axes are a little askew
IDEAL = 1e-10  # rad, m: no more askew than that is rounding
SLACK = 0.05  # of a cosine about 1, where an askew arm may reach although its ideal does not, or the other way round
MERGED_RAD = 0.01  # two postures this near to each other are hardly two
FREE, FREE_ASKEW = 1e-4, 5e-3  # sine of the angle between axes 4 and 6 below which q4 and q6 are hardly determined
CHUNK = 2048  # fits the cache, which is twice as fast


@dataclass(frozen=True, eq=False)
class Candidates:
    """What reaches N poses. Posture k has the shoulder of ``k // 4``, the wrist of ``k // 2 % 2`` and the elbow of
    ``k % 2``; along a path none changes but at a singularity.

    Attributes:
        q_rad: ``(8, 6, N)`` joints in [-pi, pi), NaN where a posture does not reach.
        singular: ``(8, N)`` where another posture is as good as the same, or q4 and q6 are not determined singly.
        free: ``(8, N)`` the latter.
        doubtful: ``(8, N)`` at the edge of reach of an arm that is askew: Newton's method has to tell.
    """

    q_rad: Array
    singular: Array
    free: Array
    doubtful: Array

    def spread(self, index: Array, count: int) -> Candidates:
        """The same as those with indices ``(N,)`` of ``count`` targets, of which the others have none."""
        q = np.full((POSTURES, 6, count), np.nan)
        flags = np.zeros((3, POSTURES, count), bool)
        q[..., index], flags[..., index] = self.q_rad, (self.singular, self.free, self.doubtful)
        return Candidates(q, *flags)


@dataclass(frozen=True, eq=False)
class ThreeParallelAxes:
    """The ideal arm nearest to a real one.

    Attributes:
        X_LB, X_FP: ``(4, 4)`` what turns X_BF into X_LP.
        w1, w5: ``(3,)`` axis 1 in L, axis 5 in P.
        along_h: h . (P - L) at zero, m.
        axes_P: ``(3, 3)`` the axes of L at zero, as rows, in P.
        p_P4: ``(3,)`` a point of axis 4 in P; p_L2: ``(2,)`` axis 2 in the plane of L.
        upper, fore, bend: lengths of the arm's links across h (m); angle from the first to the second at zero (rad).
        slack: 0 if the arm is ideal but for rounding.
    """

    X_LB: Array
    X_FP: Array
    w1: Array
    w5: Array
    along_h: float
    axes_P: Array
    p_P4: Array
    p_L2: Array
    upper: float
    fore: float
    bend: float
    slack: float

    @property
    def is_ideal(self) -> bool:
        return self.slack < SLACK

    @classmethod
    def of(cls, robot: NominalRobot) -> ThreeParallelAxes | None:
        """None if the arm is not of this kind."""
        if robot.num_joints != 6:
            return None
        w, p = robot.X_BA[:, :3, 2], robot.X_BA[:, :3, 3]
        h = w[1:4].sum(axis=0)
        h = h / max(float(np.linalg.norm(h)), 1e-300)
        askew_rad = np.linalg.norm(w[1:4] - h, axis=1).max()
        normal, between = np.cross(w[4], w[5]), p[5] - p[4]
        crossed = [np.linalg.norm(v) for v in (np.cross(h, w[0]), np.cross(h, w[4]), normal)]
        if askew_rad > PARALLEL_RAD or min(crossed) < 0.1:
            return None
        on_5 = p[4] + w[4] * (np.cross(between, w[5]) @ normal) / (normal @ normal)
        on_6 = p[5] + w[5] * (np.cross(between, w[4]) @ normal) / (normal @ normal)
        apart_m = np.linalg.norm(on_5 - on_6)
        upper, fore = (link - h * (link @ h) for link in np.diff(p[1:4], axis=0))
        if apart_m > MEET_M or min(np.linalg.norm(upper), np.linalg.norm(fore)) < MEET_M:
            return None
        x = upper / np.linalg.norm(upper)
        X_BL = lie.make_pose(np.stack([x, np.cross(h, x), h], axis=1), p[0])
        x_6 = np.cross(w[5], w[4]) / np.linalg.norm(np.cross(w[5], w[4]))
        X_BP = lie.make_pose(np.stack([x_6, np.cross(w[5], x_6), w[5]], axis=1), (on_5 + on_6) / 2)
        X_LB, X_PB = lie.invert(X_BL), lie.invert(X_BP)
        in_L = p @ X_LB[:3, :3].T + X_LB[:3, 3]
        fore_L = X_LB[:3, :3] @ fore
        return cls(
            X_LB=X_LB,
            X_FP=lie.invert(robot.X_BF) @ X_BP,
            w1=X_LB[:3, :3] @ w[0],
            w5=X_PB[:3, :3] @ w[4],
            along_h=float((X_LB @ X_BP)[2, 3]),
            axes_P=(X_PB[:3, :3] @ X_BL[:3, :3]).T,
            p_P4=X_PB[:3, :3] @ p[3] + X_PB[:3, 3],
            p_L2=in_L[1, :2],
            upper=float(np.linalg.norm(upper)),
            fore=float(np.linalg.norm(fore)),
            bend=float(np.arctan2(fore_L[1], fore_L[0])),
            slack=IDEAL if max(askew_rad, apart_m) < IDEAL else SLACK,
        )

    def solve(self, X_BF: Array) -> Candidates:
        """All postures for flange poses ``(N, 4, 4)``. Where q4 and q6 are not determined singly q6 is 0."""
        n = len(X_BF)
        q = np.empty((POSTURES, 6, n))
        flags = np.empty((3, POSTURES, n), bool)
        for start in range(0, n, CHUNK):
            part = slice(start, start + CHUNK)
            self._solve(X_BF[part], q[..., part], flags[..., part])
        return Candidates(q, *flags)

    def _solve(self, X_BF: Array, q: Array, flags: Array) -> None:
        # Poses last: X_LP as (4, 4, n), so that every step below runs along memory.
        n = len(X_BF)
        X = (X_BF.reshape(-1, 4) @ self.X_FP).reshape(n, 16).T.reshape(4, 4 * n)
        X = (self.X_LB @ X).reshape(4, 4, n)
        t = X[:3, 3]
        fixed, cos_part, sin_part = _rodrigues(self.w1, np.eye(3))  # R1 = fixed + cos q1 cos_part + sin q1 sin_part
        # Row 2 of R1^T belongs to h: (R1 e_z) . t = along_h.
        a, b, c = cos_part[2] @ t, sin_part[2] @ t, fixed[2] @ t
        half, narrow_1, edge_1 = self._arccos((self.along_h - c) / np.maximum(np.hypot(a, b), 1e-300))
        q1 = np.arctan2(b, a) + np.stack([half, -half])  # (2, n)
        # S = R1^T R, (3, 3, 2, n): where the axes of P point, after joint 1 is turned back.
        rotation = X[:3, :3].reshape(3, 3 * n)
        parts = [(part @ rotation).reshape(3, 3, 1, n) for part in (fixed, cos_part, sin_part)]
        cos, sin = np.cos(q1), np.sin(q1)
        S = parts[0] + cos * parts[1] + sin * parts[2]
        moved = [(part[:2] @ t)[:, None] for part in (fixed, cos_part, sin_part)]
        x_0, y_0 = moved[0] + cos * moved[1] + sin * moved[2] - self.p_L2[:, None, None]

        # Vectors of P that joint 5 turns back: L's x axis and z axis, and the way to axis 4.
        back = _rodrigues(self.w5, np.stack([self.axes_P[0], self.axes_P[2], self.p_P4]))
        (fixed_h, cos_h, sin_h), both = (part[1] for part in back), np.array([[1.0], [-1.0]])
        amplitude, phase = np.hypot(cos_h[2], sin_h[2]), np.arctan2(sin_h[2], cos_h[2])
        half, _, edge_5 = self._arccos((S[2, 2] - fixed_h[2]) / amplitude)
        q5 = both * half[:, None] - phase  # (2, 2, n)
        cos, sin = np.cos(q5), -np.sin(q5)
        ray, goal, point = (
            [f + cos * c + sin * s for f, c, s in zip(*(part[i] for part in back), strict=True)] for i in range(3)
        )
        b_x, b_y = S[2, 0][:, None], S[2, 1][:, None]
        cosine, sine = b_x * goal[0] + b_y * goal[1], b_x * goal[1] - b_y * goal[0]
        size = np.hypot(cosine, sine)
        free = size < (FREE if self.is_ideal else FREE_ASKEW) ** 2  # the two vectors are sin(q5) long each
        none = size < 1e-20
        size[none], cosine[none], sine[none] = 1.0, 1.0, 0.0
        c6, s6 = cosine / size, sine / size
        q6 = np.arctan2(sine, cosine)

        def seen(vector: list[Array], row: int) -> Array:
            """Component in L of a vector of P, joints 5 and 6 turned back before it and joint 1 after it."""
            x = c6 * vector[0] + s6 * vector[1]
            y = c6 * vector[1] - s6 * vector[0]
            return S[row, 0][:, None] * x + S[row, 1][:, None] * y + S[row, 2][:, None] * vector[2]

        x_4, y_4 = seen(point, 0) + x_0[:, None], seen(point, 1) + y_0[:, None]
        whole = np.arctan2(seen(ray, 1), seen(ray, 0))
        reach = (x_4 * x_4 + y_4 * y_4 - self.upper**2 - self.fore**2) / (2 * self.upper * self.fore)
        elbow, narrow_3, edge_3 = self._arccos(reach)
        ahead = np.arctan2(self.fore * np.sin(elbow), self.upper + self.fore * np.cos(elbow))
        toward = np.arctan2(y_4, x_4)

        q = q.reshape(2, 2, 2, 6, n)
        q[..., 0, :], q[..., 4, :], q[..., 5, :] = q1[:, None, None], q5[:, :, None], q6[:, :, None]
        for k, sign in enumerate((1.0, -1.0)):
            q[:, :, k, 1] = toward - sign * ahead
            q[:, :, k, 2] = sign * elbow - self.bend
        q[..., 3, :] = whole[:, :, None] - q[..., 1, :] - q[..., 2, :]
        q -= 2 * np.pi * np.floor((q + np.pi) / (2 * np.pi))
        np.copyto(q, np.nan, where=np.isnan(q[..., 3:4, :]))
        flags = flags.reshape(3, 2, 2, 2, n)
        flags[0] = (narrow_1 | narrow_3 | free)[:, :, None]
        flags[1] = free[:, :, None]
        flags[2] = (edge_1 | edge_5[:, None] | edge_3)[:, :, None] & ~self.is_ideal

    def _arccos(self, cosine: Array) -> tuple[Array, Array, Array]:
        """The angle, NaN beyond 1 but for the slack; whether it is next to 0 or pi; whether the slack matters."""
        size = np.abs(cosine)
        with np.errstate(invalid="ignore"):
            # An askew arm starts a little bent, so that Newton's method finds both postures at an edge.
            most = 1.0 if self.is_ideal else 1 - self.slack / 4
            angle = np.arccos(np.where(size > 1 + self.slack, np.nan, np.clip(cosine, -most, most)))
        return angle, size > np.cos(MERGED_RAD), np.abs(size - 1) < self.slack


def _rodrigues(axis: Array, vectors: Array) -> tuple[Array, Array, Array]:
    """Parts ``(k, 3)`` of vectors ``(k, 3)`` turned about an axis: fixed, times cosine and times sine of the angle."""
    along = np.outer(vectors @ axis, axis)
    return along, vectors - along, np.cross(axis, vectors)
