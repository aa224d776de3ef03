"""What the networks of a calibration say along a path: where they are faded, and how far they differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from truepath.lie import Array

if TYPE_CHECKING:
    from truepath.residual.ensemble import NetworkResidual

ROUNDING = 1e-6  # of a weight: nearer to 1 or 0 nobody could tell it from them
CHUNK = 20_000


@dataclass(frozen=True, eq=False)
class NetworksAlong:
    """Networks at N waypoints.

    Attributes:
        weight: ``(N,)`` by which their prediction is multiplied: 1 where the data reached, 0 where it did not.
        spread_mm: ``(N,)`` standard deviation of what they predict between them, mm, faded by the weight.
    """

    weight: Array
    spread_mm: Array

    @classmethod
    def of(cls, residual: NetworkResidual, q_rad: Array) -> NetworksAlong:
        """For commanded joints ``(N, n)``."""
        parts = [q_rad[k : k + CHUNK] for k in range(0, len(q_rad), CHUNK)]
        weight = np.concatenate([residual.weight(part) for part in parts])
        return cls(weight, 1e3 * np.concatenate([residual.spread(part) for part in parts]))

    @property
    def faded(self) -> Array:
        """``(N,)`` True where they do not speak with their full weight."""
        return self.weight < 1.0 - ROUNDING

    @property
    def spoken_mm(self) -> Array:
        """``(K,)`` the spread where they speak; where they do not, there is nothing that could differ."""
        return self.spread_mm[~self.silent]

    @property
    def silent(self) -> Array:
        """``(N,)`` True where they say nothing at all."""
        return self.weight < ROUNDING

    @property
    def corrected(self) -> str:
        """How far that which only they know is corrected where they are faded, in words."""
        if np.array_equal(self.silent, self.faded):
            return "not corrected"
        return "corrected in part or not at all" if self.silent.any() else "corrected in part only"
