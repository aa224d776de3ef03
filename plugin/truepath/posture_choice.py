"""Choosing among the postures that reach targets, along a whole program: each the nearest to the one before it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath import lie
from truepath.lie import Array
from truepath.posture_targets import Targets
from truepath.robot import NominalRobot
from truepath.ur_postures import POSTURES, ThreeParallelAxes

TURN = 2 * np.pi
MARGIN, MARGIN_RAD = 1.1, 1e-3  # the second nearest must be further off by so much, else nobody can tell
LIMIT_RAD = 1e-9
LONG_TURN_RAD = np.pi / 2  # a line on which a joint seems to turn further is looked at on the way
FEW, MANY, SMOOTH_RAD = 16, 256, 0.8
MOST_TURNS = 200
DIGIT_BITS, BIAS = 10, 256  # whole turns of six joints in one integer
CHUNK = 1024
SHIFTS = DIGIT_BITS * np.arange(6)[:, None]
GUARD = sum(1 << (DIGIT_BITS * i + DIGIT_BITS - 1) for i in range(6))
TELL_POSTURES = [0, 1, 2, 4]  # joints by which postures differ; joints 4 and 6 may share an angle as they like
NONE, ROUGH = -1, -2  # no posture; a line to be looked at


@dataclass(frozen=True, eq=False)
class Nearest:
    """Of candidates the ones nearest to joints.

    Attributes:
        posture: ``(K,)``, -1 if there is none.
        turns: ``(6, K)`` whole turns from the candidate.
        distance_rad: ``(K,)`` root of the sum of squares over the joints.
        is_tie: ``(K,)`` another posture, or the other way round, is nearly as near.
    """

    posture: Array
    turns: Array
    distance_rad: Array
    is_tie: Array


def nearest(candidates: Array, q_rad: Array, lower: Array, upper: Array) -> Nearest:
    """Of candidates ``(8, n, K)`` the nearest to joints ``(n, K)``, each joint within limits ``(n,)``."""
    _, n, count = candidates.shape
    posture, turns = np.empty(count, int), np.empty((n, count))
    distance_rad, is_tie = np.empty(count), np.empty(count, bool)
    for start in range(0, count, CHUNK):
        part = slice(start, start + CHUNK)
        turns_8, away, distance = _distances(candidates[:, :, part], q_rad[:, part], lower, upper)
        best, here = distance.argmin(axis=0), np.arange(away.shape[2])
        first = distance[best, here]
        distance_rad[part] = np.sqrt(first)
        posture[part], turns[:, part] = np.where(np.isfinite(first), best, NONE), turns_8[best, :, here].T
        distance[best, here] = np.inf
        second = distance.argmin(axis=0)
        limit = (MARGIN * distance_rad[part] + MARGIN_RAD) ** 2
        step = away[best, :, here].T
        with np.errstate(invalid="ignore"):
            other = np.abs(away[second, :, here].T - step).max(axis=0)
            is_tie[part] = (distance[second, here] < limit) & (other > MARGIN_RAD)
            # The other way round: a joint that turns by nearly half a turn.
            back = q_rad[:, part] + step - TURN * np.sign(step)
            allowed = (back >= lower[:, None] - LIMIT_RAD) & (back <= upper[:, None] + LIMIT_RAD)
            detour = first - step**2 + (TURN - np.abs(step)) ** 2
            is_tie[part] |= (allowed & (detour < limit)).any(axis=0)
    return Nearest(posture, turns, distance_rad, is_tie & (posture >= 0))


def _distances(candidates: Array, q_rad: Array, lower: Array, upper: Array) -> tuple[Array, Array, Array]:
    """Whole turns that bring candidates ``(8, 6, K)`` nearest to joints ``(6, K)``, and what is between them then
    ``(8, 6, K)``; its square sum ``(8, K)``, infinite for what cannot be.
    """
    least, most = _turn_range(candidates, lower, upper)
    turns = np.minimum(np.maximum(np.rint((q_rad - candidates) / TURN), least), most)
    away = candidates + TURN * turns - q_rad
    distance = np.einsum("pik,pik->pk", away, away)
    distance[(least > most).any(axis=1) | np.isnan(distance)] = np.inf
    return turns, away, distance


def _turn_range(candidates: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Fewest and most whole turns, as floats, ``(..., 6, K)``, with which joints are within limits ``(6,)``."""
    least = np.ceil((lower[:, None] - LIMIT_RAD - candidates) / TURN)
    most = np.floor((upper[:, None] + LIMIT_RAD - candidates) / TURN)
    return np.maximum(least, -MOST_TURNS), np.minimum(most, MOST_TURNS)


@dataclass(eq=False)
class Walk:
    """Goes along a program of which all candidates are known.

    From a posture at one target the nearest at the next is the same whatever whole turns there are, but for limits.
    So that is found for all targets at once, for each posture that turns up; what is left for each target is to look
    it up, to add its turns to those before it, all six in one integer, and to see that they are within limits.
    """

    robot: NominalRobot
    axes: ThreeParallelAxes
    targets: Targets
    candidates: Array  # (8, 6, M)
    singular: Array  # (8, M) where another posture is as good as this one

    def __post_init__(self) -> None:
        count = len(self.targets.parent)
        self.posture = np.full(count, NONE)
        self.turns = np.zeros((6, count))
        self.lost = np.zeros((POSTURES, count), bool)  # from this posture no smooth line leads to the target
        self._steps: dict[int, tuple[list[int], list[int]]] = {}
        self._ranges: dict[int, tuple[list[int], list[int]]] = {}

    def stand(self, where: Array, q_rad: Array) -> None:
        """Settles targets ``(K,)`` by the joints ``(K, 6)`` that they are."""
        free = np.full(len(TELL_POSTURES), np.inf)
        here = self.candidates[..., where][:, TELL_POSTURES]
        posture = nearest(here, q_rad[:, TELL_POSTURES].T, -free, free).posture
        where, posture, q_rad = (part[posture >= 0] for part in (where, posture, q_rad))
        turns = np.rint((q_rad - self.candidates[posture, :, where]) / TURN)
        self.candidates[posture, :, where] = q_rad - TURN * turns
        usual = (np.abs(turns) < MOST_TURNS).all(axis=1)
        self.posture[where[usual]], self.turns[:, where[usual]] = posture[usual], turns[usual].T

    def reach(self, where: Array, near_rad: Array) -> Nearest:
        """Settles targets ``(K,)`` by joints ``(K, 6)`` near them."""
        found = nearest(self.candidates[..., where], near_rad.T, self.robot.lower_rad, self.robot.upper_rad)
        self.posture[where], self.turns[:, where] = found.posture, np.nan_to_num(found.turns)
        return found

    def go(self, settled: Array) -> None:
        """Settles every target ``(M,)`` that is not and whose start is known. -1 in ``posture`` is out of reach."""
        targets = self.targets
        parent, straight = targets.parent.tolist(), targets.is_straight.tolist()
        posture, turns = self.posture.tolist(), pack(self.turns).tolist()
        for k in targets.order[~settled[targets.order]].tolist():
            p = parent[k]
            if p < 0 or (before := posture[p]) < 0:
                continue
            following, added = self._steps.get(before) or self._step(before)
            if following[k] == ROUGH:
                following[k], added[k] = self._along_rough_line(before, k)
            after, now = following[k], turns[p] + added[k]
            if after < 0:
                continue
            least, most = self._ranges.get(after) or self._range(after)
            if (((now | GUARD) - least[k]) & ((most[k] | GUARD) - now) & GUARD) != GUARD:
                after, now = (NONE, now) if straight[k] else self._within_limits(k, p, before, turns[p])
            posture[k], turns[k] = after, now
        self.posture, self.turns = np.array(posture, int), unpack(np.array(turns, np.int64))

    def _within_limits(self, k: int, p: int, before: int, turns: int) -> tuple[int, int]:
        q = self.candidates[before, :, p, None] + TURN * unpack(np.array([turns]))
        found, _, distance = _distances(self.candidates[:, :, k, None], q, self.robot.lower_rad, self.robot.upper_rad)
        best = int(distance[:, 0].argmin())
        return (best, int(pack(found[best])[0])) if distance[best, 0] < np.inf else (NONE, 0)

    def _range(self, posture: int) -> tuple[list[int], list[int]]:
        least, most = _turn_range(self.candidates[posture], self.robot.lower_rad, self.robot.upper_rad)
        impossible = (~(least <= most)).any(axis=0)
        least[:, impossible], most[:, impossible] = MOST_TURNS, -MOST_TURNS
        self._ranges[posture] = pack(least).tolist(), pack(most).tolist()
        return self._ranges[posture]

    def _step(self, before: int) -> tuple[list[int], list[int]]:
        """From one posture at the parents: the posture at each target, and the turns to add in one integer."""
        targets, count = self.targets, len(self.targets.parent)
        following, added = np.full(count, NONE), np.zeros((6, count))
        straight = targets.follows & targets.is_straight
        # From where two postures are one a line may go on in either.
        straight[straight] = ~self.singular[before, targets.parent[straight]]
        for where, choose in ((straight, self._along_lines), (targets.follows & ~straight, self._to_nearest)):
            index = np.flatnonzero(where)
            if len(index):
                following[index], added[:, index] = choose(before, index)
        self._steps[before] = following.tolist(), _digits(added).tolist()
        return self._steps[before]

    def _to_nearest(self, before: int, index: Array) -> tuple[Array, Array]:
        following, added = np.empty(len(index), int), np.empty((6, len(index)))
        for begin in range(0, len(index), CHUNK):
            part = slice(begin, begin + CHUNK)
            start, ends = (
                self.candidates[before][:, self.targets.parent[index[part]]],
                self.candidates[:, :, index[part]],
            )
            turns = np.rint((start - ends) / TURN)
            away = ends + TURN * turns - start
            distance = np.einsum("pik,pik->pk", away, away)
            distance[np.isnan(distance)] = np.inf
            best, here = distance.argmin(axis=0), np.arange(away.shape[2])
            found = np.isfinite(distance[best, here])
            following[part], added[:, part] = np.where(found, best, NONE), np.where(found, turns[best, :, here].T, 0)
        return following, added

    def _along_lines(self, before: int, index: Array) -> tuple[Array, Array]:
        start = self.candidates[before][:, self.targets.parent[index]]
        end = self.candidates[before][:, index]
        turns = np.rint((start - end) / TURN)
        following = np.where(np.isnan(end[0]), NONE, before)
        with np.errstate(invalid="ignore"):
            long = np.flatnonzero((np.abs(end + TURN * turns - start) > LONG_TURN_RAD).any(axis=0) & (following >= 0))
        following[long] = ROUGH
        turned, smooth = self._turned(before, index[long], FEW)
        done = long[smooth]
        following[done] = before
        turns[:, done] = np.rint((start[:, done] + turned[:, smooth] - end[:, done]) / TURN)
        return following, np.nan_to_num(turns)

    def _along_rough_line(self, before: int, k: int) -> tuple[int, int]:
        """The same for one line that needs a closer look, being one on which joints turn fast."""
        index = np.array([k])
        turned, smooth = self._turned(before, index, MANY)
        if smooth[0]:
            change = self.candidates[before, :, k] - self.candidates[before, :, self.targets.parent[k]]
            return before, int(_digits(np.rint((turned[:, 0] - change) / TURN)[:, None])[0])
        # Through a singularity, where one posture becomes another.
        self.lost[before, k] = True
        following, turns = self._to_nearest(before, index)
        return int(following[0]), int(_digits(turns)[0])

    def _turned(self, posture: int, index: Array, samples: int) -> tuple[Array, Array]:
        """By how much joints turn ``(6, K)`` along straight lines, and whether they do so without a jump ``(K,)``."""
        share = np.linspace(0, 1, samples + 1)
        turned, smooth = np.empty((6, len(index))), np.empty(len(index), bool)
        for begin in range(0, len(index), CHUNK // 16):
            part = slice(begin, begin + CHUNK // 16)
            way = poses_between(self.targets.X[self.targets.parent[index[part]]], self.targets.X[index[part]], share)
            q = self.axes.solve(way.reshape(-1, 4, 4)).q_rad[posture].reshape(6, -1, samples + 1)
            steps = np.diff(q, axis=2)
            steps -= TURN * np.rint(steps / TURN)
            turned[:, part], smooth[part] = steps.sum(axis=2), np.abs(steps).max(axis=(0, 2)) < SMOOTH_RAD
        return turned, smooth


def poses_between(X_from: Array, X_to: Array, share: Array) -> Array:
    """``(K, S, 4, 4)`` poses on the straight lines between ``(K, 4, 4)`` each, at shares of them ``(S,)``."""
    way = share[:, None] * lie.pose_error(X_to, X_from)[:, None]  # (K, S, 6)
    rotation = lie.from_rotation_vector(way[..., :3]) @ X_from[:, None, :3, :3]
    return lie.make_pose(rotation, X_from[:, None, :3, 3] + way[..., 3:])


def pack(turns: Array) -> Array:
    """``(K,)`` integers that hold whole turns ``(6, K)``, each 200 at most."""
    return _digits(turns + BIAS)


def unpack(packed: Array) -> Array:
    return (packed >> SHIFTS & ((1 << DIGIT_BITS) - 1)).astype(float) - BIAS


def _digits(turns: Array) -> Array:
    return np.asarray((turns.astype(np.int64) << SHIFTS).sum(axis=0))
