"""How a campaign drives and measures, with defaults that are safe beside a robot."""

from __future__ import annotations

import math
from dataclasses import dataclass

from truepath.errors import InputError

FASTEST_DEG_S = 180.0
FASTEST_DEG_S2 = 800.0
LONGEST_S = 600.0


@dataclass(frozen=True)
class Manner:
    """How to drive and measure.

    Attributes:
        speed_deg_s, acceleration_deg_s2: of the joint that has furthest to go.
        settle_s: how long the robot must have stood still.
        measure_s: how long the tracker is read.
        max_spread_mm: of the readings; more, and the reflector is not still.
        tries: at each pose, before it is left for later.
        between_tries_s: so that a beam can come back.
        rest_s: for how long the robot may take to come to rest.
        skipped_in_a_row: after so many poses without a reading the campaign stops: the tracker has lost the reflector.
    """

    speed_deg_s: float = 20.0
    acceleration_deg_s2: float = 40.0
    settle_s: float = 1.0
    measure_s: float = 1.0
    max_spread_mm: float = 0.15
    tries: int = 3
    between_tries_s: float = 2.0
    rest_s: float = 15.0
    skipped_in_a_row: int = 3

    def __post_init__(self) -> None:
        for name, most in (
            ("speed_deg_s", FASTEST_DEG_S),
            ("acceleration_deg_s2", FASTEST_DEG_S2),
            ("settle_s", LONGEST_S),
            ("measure_s", LONGEST_S),
            ("max_spread_mm", 10.0),
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0 < value <= most):
                raise InputError(f"this is no {name}", expected=f"more than 0, at most {most:g}", found=str(value))
        if self.tries < 1:
            raise InputError("every pose needs a try", expected="1 or more", found=str(self.tries))
