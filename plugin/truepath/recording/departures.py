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
MOST_BEFORE_S = 0.5  # readings of the place that is left
LEAST_READINGS = 3
SILENCE_S = 1.0
LONGEST_GAP_S = 0.25
LONGEST_GAP_IN_PERIODS = 3.0
REMEMBERED = 3
POLL_S = 0.02


class Departures:
    """The delay of a tracker, from the last moves that tell it.

    Args:
        tracker: that is watched.
        robot: nominal; its flange says when the reflector must begin to move.
        stood_s: for how long at least the tracker shows the robot standing before each move.
    """

    def __init__(self, tracker: Tracker, robot: NominalRobot, stood_s: float) -> None:
        self._before_s = min(stood_s, MOST_BEFORE_S)
        self._tracker = tracker
        self._model = nominal_model(robot)
        self._delays_s: deque[float] = deque(maxlen=REMEMBERED)
        self._stood_s: float | None = None

    @property
    def delay_s(self) -> float:
        """The longest of the last delays, s; 0 while none is known."""
        return max(self._delays_s, default=0.0)

    def robot_stands(self) -> None:
        """To be called when the robot stands and is about to be moved: what the tracker shows now is the place left."""
        if self._stood_s is None:  # the tracker may have been opened just now
            began_s = time.monotonic()
            end_s = began_s + SILENCE_S
            while len(self._tracker.seen_since(began_s)) < LEAST_READINGS and time.monotonic() < end_s:
                time.sleep(POLL_S)
        self._stood_s = time.monotonic()

    def look(self, samples: Sequence[RobotState]) -> None:
        """Compares a move with what the tracker showed of it; waits for up to 5 s until it does.

        A move that tells nothing (too short, a broken beam, a gap in either stream) leaves the delay as it was.

        Args:
            samples: of the robot, from standstill to the end of the move.

        Raises:
            RobotFault: the readings show nothing of a move that went far.
        """
        assert self._stood_s is not None
        left_s, farthest_m = self._robot_left(samples)
        if left_s is None:
            return
        while True:
            seen = self._tracker.seen_since(self._stood_s - self._before_s)
            if not seen or any(numbers is None for _, numbers in seen):
                return
            moments = np.array([moment for moment, _ in seen])
            positions = 1e-3 * np.array([numbers[1:4] for _, numbers in seen if numbers is not None])
            before = moments <= self._stood_s
            if before.sum() < LEAST_READINGS or np.ptp(positions[before], axis=0).max() > LEFT_M:
                return
            first = _first_away(positions, before)
            if first is not None:
                if not _gap_before(moments, first, before):
                    self._delays_s.append(max(float(moments[first]) - left_s, 0.0))
                return
            if moments[-1] > left_s + LATEST_S:
                if farthest_m < FAR_M:
                    return
                raise RobotFault(
                    f"the tracker shows nothing of a move of {1e3 * farthest_m:.0f} mm: its readings are frozen, more "
                    f"than {LATEST_S:g} s late, or of another reflector"
                )
            if time.monotonic() > left_s + LATEST_S + PATIENCE_S:
                return
            time.sleep(POLL_S)

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


def _first_away(positions: Array, before: Array) -> int | None:
    """Index of the first of three readings in a row that are away from where the readings ``before`` were.

    Args:
        positions: ``(K, 3)`` m.
        before: ``(K,)`` bool, taken while the robot stood.
    """
    place = np.median(positions[before], axis=0)
    distance_m = np.linalg.norm(positions - place, axis=1)
    away = (distance_m > max(LEFT_M, LEFT_IN_NOISES * float(np.median(distance_m[before])))) & ~before
    three = np.flatnonzero(away[:-2] & away[1:-1] & away[2:])
    return int(three[0]) if len(three) else None


def _gap_before(moments: Array, first: int, before: Array) -> bool:
    """Whether nothing came for so long that the first reading away says little about when the reflector left."""
    if first == 0:
        return True
    period_s = float(np.median(np.diff(moments[before])))
    longest_s = max(LONGEST_GAP_S, LONGEST_GAP_IN_PERIODS * period_s)
    return bool(moments[first] - moments[first - 1] > longest_s)
