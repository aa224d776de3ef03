"""Which targets of a program a robot has passed, and how near: found in the stream of its joints."""

from __future__ import annotations

import numpy as np

from truepath.lie import Array

ZONE_RAD = 0.02  # a target is looked for when all joints are as near as this
ZONE_RAD_PER_M_OF_BLEND = 12.0
STEPS_AROUND = 0.75  # of the way between two samples: how far from both a target on it can lie
PASSED_RAD = 5e-4  # by so much further away than it was: it is behind
GAP_S, GAP_STEPS = 0.1, 5  # nothing was seen for so long, and for so many times as usual
LOOK_AHEAD = 200  # targets that may have been passed unseen
FASTEST_RAD_S = np.pi  # of a joint: sooner, nobody can have passed what lies between


class Passages:
    """Closest approaches to targets in their order, as samples come in.

    Between two samples the joints are taken to go straight, but not where nothing was seen for a while: then targets
    may have been passed unseen. That is judged when the motion has ended: the next target counts to which the robot
    has come later, if there was time enough for those between. A target counts as passed when the robot has been near
    it and goes away again, or when the motion has ended there.

    Args:
        q_rad: ``(N, 6)`` joints of the targets.
        blend_m: ``(N,)`` radius within which a target is passed by.

    Attributes:
        reached_rad: ``(N, 6)`` joints at the closest approach, NaN while not passed, or passed unseen.
        time_s: ``(N,)`` of the controller's clock then.
        count: of targets passed, unseen ones included.
    """

    def __init__(self, q_rad: Array, blend_m: Array) -> None:
        self._goals = q_rad
        self._zone = ZONE_RAD + ZONE_RAD_PER_M_OF_BLEND * blend_m
        self.reached_rad = np.full(q_rad.shape, np.nan)
        self.time_s = np.full(len(q_rad), np.nan)
        self.count = 0
        self._path = np.empty((0, 7))  # time and joints since the last target that was passed
        self._usual_s = np.inf  # between two samples
        self._since_s = np.inf  # when that was
        self._unseen = False  # whether there has been a gap since then

    def take(self, time_s: Array, q_rad: Array, ended: bool = False) -> None:
        """More samples.

        Args:
            time_s: ``(B,)``.
            q_rad: ``(B, 6)`` actual joints.
            ended: nothing comes after these.
        """
        self._path = np.vstack([self._path, np.column_stack([time_s, q_rad])])
        if len(self._path) == 1:
            self._path = np.repeat(self._path, 2, axis=0)
        self._since_s = min(self._since_s, float(self._path[0, 0]))
        if len(time_s) > 1:
            self._usual_s = min(self._usual_s, float(np.median(np.diff(time_s))))
        self._unseen |= bool(self._gaps().any())
        while self.count < len(self._goals) and len(self._path) >= 2:
            if not (self._passes(self.count, ended) or self._passes_later_one(ended)):
                if not self._unseen and not self._near(self.count)[0].any():
                    self._path = self._path[-1:]
                return

    def _gaps(self) -> Array:
        """``(B - 1,)`` True for steps of the path on which nothing was seen."""
        least = max(GAP_S, GAP_STEPS * self._usual_s) if np.isfinite(self._usual_s) else np.inf
        return np.diff(self._path[:, 0]) > least

    def _near(self, target: int) -> tuple[Array, Array, Array]:
        """For each step of the path, whether it comes near, how near, and at which share of it."""
        start, step = self._path[:-1], np.diff(self._path, axis=0)
        to_goal = self._goals[target] - start[:, 1:]
        length = np.einsum("ij,ij->i", step[:, 1:], step[:, 1:])
        along = np.einsum("ij,ij->i", to_goal, step[:, 1:])
        share = np.clip(np.divide(along, length, out=np.zeros_like(along), where=length > 0), 0.0, 1.0)
        gaps = self._gaps()
        share[gaps] = 1.0  # only its end was seen
        away = np.abs(to_goal - share[:, None] * step[:, 1:]).max(axis=1)
        around = np.where(gaps, 0.0, STEPS_AROUND * np.abs(step[:, 1:]).max(axis=1))
        return away <= np.maximum(self._zone[target], around), away, share

    def _passes(self, target: int, ended: bool) -> bool:
        inside, away, share = self._near(target)
        if not inside.any():
            return False
        first = int(np.argmax(inside))
        visit = away[first:]
        receding = visit > np.minimum.accumulate(visit) + PASSED_RAD
        if not (receding.any() or ended):
            return False
        best = first + int(np.argmin(visit[: int(np.argmax(receding)) if receding.any() else len(visit)]))
        if self._path[best + 1, 0] - self._since_s < self._least_time_s(target):
            return False
        closest = self._path[best] + share[best] * (self._path[best + 1] - self._path[best])
        at_a_gap = bool(self._gaps()[max(best - 1, 0) : best + 2].any())
        if not (at_a_gap and away[best] > PASSED_RAD):  # else it was nearer while nothing was seen
            self.time_s[target], self.reached_rad[target] = closest[0], closest[1:]
        self.count, self._since_s = target + 1, float(closest[0])
        self._path = np.vstack([closest, self._path[best + 1 :]])
        self._unseen = bool(self._gaps().any())
        return True

    def _least_time_s(self, target: int) -> float:
        """That the way over all targets from the one passed last takes."""
        legs = np.diff(self._goals[max(self.count - 1, 0) : target + 1], axis=0)
        return float(np.abs(legs).max(axis=1, initial=0.0).sum()) / FASTEST_RAD_S if target > self.count else 0.0

    def _passes_later_one(self, ended: bool) -> bool:
        if not (ended and self._unseen) or self._near(self.count)[0].any():
            return False
        later = range(self.count + 1, min(self.count + LOOK_AHEAD, len(self._goals)))
        return any(self._passes(target, ended) for target in later)
