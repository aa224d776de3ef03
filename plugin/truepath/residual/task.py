"""What an evolution is to learn, as it wants it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch

from truepath.lie import Array
from truepath.residual.evaluation import Blocks
from truepath.residual.network import Tensor, with_ones


@dataclass(frozen=True, eq=False)
class Task:
    """Samples in single precision, on the device that evaluates networks.

    Attributes:
        x1: ``(d + 1, N)`` inputs as ``network.with_ones`` makes them.
        target: ``(k, N)``.
    """

    x1: Tensor
    target: Tensor

    @classmethod
    def of(cls, x: Array, target: Array, device: str = "cpu") -> Task:
        """From ``(N, d)`` inputs, scaled to about -1 to 1, and ``(N, k)`` outputs, scaled to about one."""
        where = torch.device(device)
        wanted = np.ascontiguousarray(target.T)
        return cls(
            with_ones(torch.tensor(x, dtype=torch.float32, device=where)),
            torch.tensor(wanted, dtype=torch.float32, device=where),
        )

    @cached_property
    def blocks(self) -> Blocks:
        """The same for the kernels of a CPU."""
        return Blocks.of(self.x1.numpy(), self.target.numpy())
