"""The time in which a virtual robot lives."""

from __future__ import annotations

import math
import time

from truepath.errors import InputError

MOST_SPEED_UP = 1000.0


class Clock:
    """Seconds since the controller was switched on, ``speed_up`` times faster than those on the wall.

    Everything that the robot knows of runs by it: motion, temperatures, time stamps, the tracker. Whoever talks to the
    robot lives by the wall.
    """

    def __init__(self, speed_up: float = 1.0) -> None:
        if not (math.isfinite(speed_up) and 0 < speed_up <= MOST_SPEED_UP):
            raise InputError(
                "no such speed-up", expected=f"more than 0, {MOST_SPEED_UP:g} at most", found=str(speed_up)
            )
        self.speed_up = speed_up
        self._start = time.monotonic()

    def now(self) -> float:
        """Seconds of the robot."""
        return self.at_wall(time.monotonic())

    def at_wall(self, monotonic_s: float) -> float:
        """The same for a reading of the monotonic clock."""
        return (monotonic_s - self._start) * self.speed_up

    def wall_seconds(self, seconds: float) -> float:
        """How long that takes on the wall."""
        return seconds / self.speed_up
