"""The residual as a part of the robot's model: several networks, their mean, and where they may speak."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath.lie import Array
from truepath.residual.network import Network, one_thread, outputs
from truepath.residual.reach import Reach


@dataclass(frozen=True, eq=False)
class NetworkResidual:
    """What the rest of the model leaves, as the mean of networks that each saw another part of the data.

    Attributes:
        networks: from joints, scaled by ``reach``, to misses in units of ``scale``.
        scale: ``(3,)`` m, or with orientations ``(6,)`` m and rad.
        reach: where the data was.
        p_FE: ``(3,)`` where the probe sat on the flange when they learnt, m: what they turn, they turn about it, also
            when another probe is there. None: where the model of which they are a part has it.
    """

    networks: tuple[Network, ...]
    scale: Array
    reach: Reach
    p_FE: Array | None = None

    def shift(self, q_rad: Array) -> Array:
        """``(N, 6)`` shift and turn of the probe by which the robot differs from the rest of the model.

        m and rad, in the real base B; the turn is zero where orientations were not measured. ``q_rad`` ``(N, n)`` are
        commanded joints. Fades to zero where the data did not reach.
        """
        out = np.zeros((len(q_rad), 6))
        out[:, : len(self.scale)] = self._each(q_rad).mean(axis=0) * self.weight(q_rad)[:, None]
        return out

    def spread(self, q_rad: Array) -> Array:
        """``(N,)`` standard deviation of the shift between the networks, m; faded likewise."""
        if len(self.networks) < 2:
            return np.zeros(len(q_rad))
        variance = self._each(q_rad)[:, :, :3].var(axis=0, ddof=1).sum(axis=1)
        return np.sqrt(variance) * self.weight(q_rad)

    def weight(self, q_rad: Array) -> Array:
        """``(N,)`` 1 where the data reached, 0 where it did not."""
        return self.reach.weight(q_rad)

    def _each(self, q_rad: Array) -> Array:
        with one_thread():
            return outputs(self.networks, self.reach.scaled(q_rad)) * self.scale
