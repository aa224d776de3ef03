"""What befalls RTDE packages between controller and client, on demand."""

from __future__ import annotations

import asyncio
import random
import time

LOST_SHARE = 0.5
LEAST_LATE_S, MOST_LATE_S = 0.05, 0.3  # less than what a client takes for a lost connection
BETWEEN_S = 0.5  # from one delay to the next, so that a client can catch up


class PacketWeather:
    """Fair, unless a fault is under way. Times are the wall's."""

    def __init__(self, seed: int) -> None:
        self.dice = random.Random(seed)
        self._late_until, self._lossy_until = 0.0, 0.0

    def make_late(self, seconds: float) -> None:
        """From now on packages are held back now and then, up to ``MOST_LATE_S``, and come in bursts; none is lost."""
        self._late_until = time.monotonic() + seconds

    def lose(self, seconds: float) -> None:
        """From now on half of the packages do not come."""
        self._lossy_until = time.monotonic() + seconds

    def clear(self) -> None:
        """Fair again."""
        self._late_until = self._lossy_until = 0.0

    @property
    def is_late(self) -> bool:
        """Whether packages are held back."""
        return time.monotonic() < self._late_until

    @property
    def is_lossy(self) -> bool:
        """Whether packages are lost."""
        return time.monotonic() < self._lossy_until


class StreamWeather:
    """The same for one client's stream."""

    def __init__(self, weather: PacketWeather) -> None:
        self._weather, self._next_delay = weather, 0.0

    def loses_package(self) -> bool:
        """Whether the next one is lost."""
        return self._weather.is_lossy and self._weather.dice.random() < LOST_SHARE

    async def delay(self) -> None:
        """Waits as long as the next one is late."""
        now = time.monotonic()
        if self._weather.is_late and now >= self._next_delay:
            held = self._weather.dice.uniform(LEAST_LATE_S, MOST_LATE_S)
            self._next_delay = now + held + BETWEEN_S
            await asyncio.sleep(held)
