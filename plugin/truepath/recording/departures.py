"""How late a tracker is: its readings must begin to change when the robot leaves the place where it stood.

A stream that is late by the same time in every reading looks like one in time: still readings, only of the pose
before. What gives it away is the beginning of a move, which the robot tells over RTDE at 125 Hz.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence

import numpy as np

from truepath.lie import Array
from truepath.model import nominal_model
from truepath.recording.trackers import Tracker
from truepath.robot import NominalRobot
from truepath.robot_link import RobotFault, RobotState

LATEST_S = 5.0
PATIENCE_S = 3.0  # beyond that, for readings that a file is given in one go
LEFT_M = 1e-3  # of flange and reflector: far above the noise, and gone through within a tenth of a second
LEFT_IN_NOISES = 6.0
FAR_M = 0.02  # a flange that goes so far takes the reflector along
LEAST_READINGS = 3
BEFORE_S, BEFORE_IN_PERIODS = 0.5, 5.0  # readings of the place that is left: so long, but so many at least
LONGEST_GAP_S = 0.25
LONGEST_GAP_IN_PERIODS = 3.0
REMEMBERED = 3
MOST_UNJUDGED = 3
POLL_S = 0.02


class Departures:
    """The delay of a tracker, from the last moves that tell it.

    Args:
        tracker: that is watched.
        robot: nominal; its flange says when the reflector must begin to move.
    """

    def __init__(self, tracker: Tracker, robot: NominalRobot) -> None:
        self._tracker = tracker
        self._model = nominal_model(robot)
        self._delays_s: deque[float] = deque(maxlen=REMEMBERED)
        self._unjudged = 0
        self._shown_since_s: float | None = None
        self._stood_s: float | None = None

    @property
    def delay_s(self) -> float:
        """The longest of the last delays, s; while none is known, the longest that may be."""
        return max(self._delays_s, default=LATEST_S)

    def tracker_shows_standing(self) -> None:
        """To be called at each pose when the robot has stood there for longer than the delay."""
        self._shown_since_s = time.monotonic()

    def robot_leaves(self) -> None:
        """To be called when the robot stands and is about to be moved: what the tracker shows now is the place left.

        Waits, once, until a tracker that was opened just now has shown something.
        """
        if self._shown_since_s is None:
            self._shown_since_s = time.monotonic()
            end_s = self._shown_since_s + LATEST_S + PATIENCE_S
            while len(self._tracker.seen_since(self._shown_since_s)) < LEAST_READINGS and time.monotonic() < end_s:
                time.sleep(POLL_S)
        self._stood_s = time.monotonic()

    def look(self, samples: Sequence[RobotState]) -> None:
        """Compares a move with what the tracker showed of it; waits for up to 5 s until it does.

        A move that tells nothing (too short, a broken beam, a gap in either stream) leaves the delay as it was.

        Args:
            samples: of the robot, from standstill to the end of the move.

        Raises:
            RobotFault: the readings show nothing of a move that went far; or come so seldom, or so unsteadily, that
                after some moves nobody can tell how late they are.
        """
        left_s, farthest_m = self._robot_left(samples)
        if left_s is None:
            return
        delay_s, is_broken = self._delay_of(left_s, farthest_m)
        if delay_s is not None:
            self._delays_s.append(delay_s)
        elif farthest_m >= FAR_M and not is_broken:
            self._unjudged += 1
            if not self._delays_s and self._unjudged >= MOST_UNJUDGED:
                raise RobotFault(
                    f"{self._unjudged} moves have not told how late the tracker's readings are: they come too seldom, "
                    "with gaps, or move where the robot stands"
                )

    def _delay_of(self, left_s: float, farthest_m: float) -> tuple[float | None, bool]:
        """How late the readings of a move from ``left_s`` on are, None if they do not tell; whether the beam broke."""
        while True:
            seen, is_broken = self._seen_unbroken()
            moments = np.array([moment for moment, _ in seen])
            positions = 1e-3 * np.array([numbers[1:4] for _, numbers in seen]).reshape(-1, 3)
            before = self._last_before(moments)
            if before.sum() < LEAST_READINGS or np.ptp(positions[before], axis=0).max() > LEFT_M:
                return None, is_broken
            first = _first_away(positions, moments > self._stood(), before)
            if first is not None and moments[first] <= left_s + LATEST_S:
                late_s = max(float(moments[first]) - left_s, 0.0)
                return (None if _gap_before(moments, first, before) else late_s), is_broken
            if is_broken:
                return None, True
            if moments[-LEAST_READINGS] > left_s + LATEST_S:
                if farthest_m < FAR_M:
                    return None, False
                raise RobotFault(
                    f"the tracker shows nothing of a move of {1e3 * farthest_m:.0f} mm: its readings are frozen, more "
                    f"than {LATEST_S:g} s late, or of another reflector"
                )
            if time.monotonic() > left_s + LATEST_S + PATIENCE_S:
                return None, False
            time.sleep(POLL_S)

    def _seen_unbroken(self) -> tuple[list[tuple[float, tuple[float, ...]]], bool]:
        """What was seen since the robot was last shown standing, up to where the beam broke; whether it broke."""
        assert self._shown_since_s is not None
        found: list[tuple[float, tuple[float, ...]]] = []
        for moment_s, numbers in self._tracker.seen_since(self._shown_since_s):
            if numbers is None:
                return found, True
            found.append((moment_s, numbers))
        return found, False

    def _stood(self) -> float:
        assert self._stood_s is not None
        return self._stood_s

    def _last_before(self, moments: Array) -> Array:
        """``(K,)`` bool: readings of the last while, or the last few, in which the robot had not been moved."""
        before = moments <= self._stood()
        if before.sum() < LEAST_READINGS:
            return before
        period_s = float(np.median(np.diff(moments[before])))
        return before & (moments >= self._stood() - max(BEFORE_S, BEFORE_IN_PERIODS * period_s))

    def _robot_left(self, samples: Sequence[RobotState]) -> tuple[float | None, float]:
        """When the flange had left by 1 mm, None if that cannot be told, and how far it came, m."""
        if len(samples) < 2:
            return None, 0.0
        arrived_s = np.array([state.arrived_s for state in samples])
        flange = self._model.predict(np.array([state.q_rad for state in samples]))[:, :3, 3]
        distance_m = np.linalg.norm(flange - flange[0], axis=1)
        away = np.flatnonzero(distance_m > LEFT_M)
        if not len(away) or arrived_s[away[0]] - arrived_s[away[0] - 1] > LONGEST_GAP_S:
            return None, 0.0
        return float(arrived_s[away[0]]), float(distance_m.max())


def _first_away(positions: Array, after: Array, before: Array) -> int | None:
    """Index of the first of three readings in a row that are away from where the readings ``before`` were.

    Args:
        positions: ``(K, 3)`` m.
        after: ``(K,)`` bool, taken when the robot may have moved.
        before: ``(K,)`` bool, taken while it stood.
    """
    place = np.median(positions[before], axis=0)
    distance_m = np.linalg.norm(positions - place, axis=1)
    away = (distance_m > max(LEFT_M, LEFT_IN_NOISES * float(np.median(distance_m[before])))) & after
    three = np.flatnonzero(away[:-2] & away[1:-1] & away[2:])
    return int(three[0]) if len(three) else None


def _gap_before(moments: Array, first: int, before: Array) -> bool:
    """Whether nothing came for so long that the first reading away says little about when the reflector left."""
    if first == 0:
        return True
    period_s = float(np.median(np.diff(moments[before])))
    longest_s = max(LONGEST_GAP_S, LONGEST_GAP_IN_PERIODS * period_s)
    return bool(moments[first] - moments[first - 1] > longest_s)
