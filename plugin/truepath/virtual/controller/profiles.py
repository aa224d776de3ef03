"""How far along its way a motion is: speed rises, stays, falls, as a UR's does."""

from __future__ import annotations

import math
from dataclasses import dataclass

from truepath.errors import InputError

LEAST_SPEED, LEAST_ACCELERATION = 1e-6, 1e-6
MOST_DURATION_S = 24 * 3600.0


@dataclass(frozen=True)
class Trapezoid:
    """From 0 to 1 of the way, at rest at both ends.

    Attributes:
        duration_s: of all.
        ramp_s: of the acceleration, and of the deceleration; half the duration at most.
    """

    duration_s: float
    ramp_s: float

    @classmethod
    def of(cls, length: float, speed: float, acceleration: float, time_s: float | None = None) -> Trapezoid:
        """Over a length, rad or m, at a speed and acceleration in the same unit; in a time instead, if one is given.

        Raises:
            InputError: a speed or acceleration that moves nothing, or a number that is none.
        """
        if not all(map(math.isfinite, (length, speed, acceleration, time_s or 0.0))):
            raise InputError("a motion without finite length, speed, acceleration and time")
        if length == 0.0:
            return cls(0.0, 0.0)
        if time_s is not None and time_s > 0:
            return cls(time_s, 0.25 * time_s)
        if speed < LEAST_SPEED or acceleration < LEAST_ACCELERATION:
            raise InputError(
                "a motion without speed or acceleration", expected="positive numbers", found=f"{speed}, {acceleration}"
            )
        ramp = speed / acceleration
        if speed * ramp <= length:
            duration = length / speed + ramp
        else:
            ramp = math.sqrt(length / acceleration)
            duration = 2 * ramp
        if duration > MOST_DURATION_S:
            raise InputError("a motion that would take more than a day", found=f"{duration:.3g} s")
        return cls(duration, ramp)

    def at(self, time_s: float) -> tuple[float, float]:
        """Share of the way, and its change per second."""
        if time_s <= 0.0 or self.duration_s == 0.0:
            return (0.0 if self.duration_s > 0.0 else 1.0), 0.0
        left = self.duration_s - time_s
        if left <= 0.0:
            return 1.0, 0.0
        top = 1.0 / (self.duration_s - self.ramp_s)
        if time_s < self.ramp_s:
            return 0.5 * top * time_s**2 / self.ramp_s, top * time_s / self.ramp_s
        if left < self.ramp_s:
            return 1.0 - 0.5 * top * left**2 / self.ramp_s, top * left / self.ramp_s
        return top * (time_s - 0.5 * self.ramp_s), top

    def overlap(self, share: float) -> float:
        """How long before its end a motion has no more than this share left, while it slows down already."""
        if self.ramp_s == 0.0:
            return 0.0
        top = 1.0 / (self.duration_s - self.ramp_s)
        return min(self.ramp_s, math.sqrt(2.0 * max(share, 0.0) * self.ramp_s / top))
