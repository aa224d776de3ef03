"""How late readings arrive: whoever writes a file may keep lines back for seconds, and old ones must not count."""

from __future__ import annotations

import math

import numpy as np

from truepath.lie import Array

REMEMBERED_S = 300.0  # clocks drift apart, by a few hundredths of a second in this time
BUCKET_S = 30.0


class Lateness:
    """Compares the tracker's clock with this machine's: the readings that came through fastest set the standard."""

    def __init__(self) -> None:
        self._least: dict[int, float] = {}

    def moments(self, arrived_s: float, t_s: Array) -> Array:
        """When readings that arrived together were taken, by this machine's clock; never later than they arrived.

        Args:
            arrived_s: of all of them.
            t_s: ``(K,)`` the tracker's clock.
        """
        bucket = math.floor(arrived_s / BUCKET_S)
        self._least[bucket] = min(self._least.get(bucket, math.inf), float(arrived_s - t_s.max()))
        oldest = math.floor((arrived_s - REMEMBERED_S) / BUCKET_S)
        self._least = {key: value for key, value in self._least.items() if key >= oldest}
        return np.minimum(t_s + min(self._least.values()), arrived_s)
