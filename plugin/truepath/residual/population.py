"""Many networks of different hidden size as a few tensors, so that all of them are evaluated at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from truepath.residual.network import Network, Tensor, activations, stacked

CACHE_BYTES = 640 << 10  # activations of so many networks at a time stay in a core's own cache
GPU_BYTES = 1 << 30


@dataclass(frozen=True, eq=False)
class Population:
    """P networks of d inputs and k outputs, padded to the same number L of hidden neurons.

    Attributes:
        hidden: ``(P, L, d + 1)``.
        output: ``(P, k, L)``, zero for neurons that a network does not have.
        bias: ``(P, k)``.
        sizes: ``(P,)`` number of hidden neurons of each.
    """

    hidden: Tensor
    output: Tensor
    bias: Tensor
    sizes: Tensor

    def __len__(self) -> int:
        return len(self.sizes)

    @property
    def room(self) -> int:
        """Most hidden neurons that a network of this population can have."""
        return self.hidden.shape[1]

    @classmethod
    def random(
        cls, sizes: Tensor, room: int, inputs: int, outputs: int, generator: torch.Generator, dtype: torch.dtype
    ) -> Population:
        """Networks of those sizes with all weights drawn from -1 to 1, as in the paper's figure 5."""
        count, device = len(sizes), sizes.device
        hidden, output, bias = (
            uniform(shape, generator, device, dtype)
            for shape in ((count, room, inputs + 1), (count, outputs, room), (count, outputs))
        )
        return cls(hidden, output, bias, sizes).trimmed()

    @classmethod
    def of(cls, networks: Sequence[Network], room: int, device: torch.device, dtype: torch.dtype) -> Population:
        """Given networks."""
        hidden, output, bias = stacked(networks, room)
        sizes = torch.tensor([network.neurons for network in networks], device=device)
        return cls(hidden.to(device, dtype), output.to(device, dtype), bias.to(device, dtype), sizes)

    def has(self) -> Tensor:
        """``(P, L)`` True for the neurons that a network has."""
        return torch.arange(self.room, device=self.sizes.device) < self.sizes[:, None]

    def trimmed(self) -> Population:
        """Neurons that a network does not have made silent."""
        return replace(self, output=self.output * self.has()[:, None])

    def network(self, number: int) -> Network:
        """One of them, without the padding."""
        size = int(self.sizes[number])
        parts = (self.hidden[number, :size], self.output[number, :, :size], self.bias[number])
        return Network(*(part.double().cpu().numpy() for part in parts))

    def where(self, chosen: Tensor, other: Population) -> Population:
        """The other's networks where ``chosen`` ``(P,)``, else these."""
        return Population(
            torch.where(chosen[:, None, None], other.hidden, self.hidden),
            torch.where(chosen[:, None, None], other.output, self.output),
            torch.where(chosen[:, None], other.bias, self.bias),
            torch.where(chosen, other.sizes, self.sizes),
        )

    def mean_squared_error(self, x1: Tensor, target: Tensor) -> Tensor:
        """``(P,)`` squared miss per sample, averaged over the samples (eq. 15).

        Networks of like size are evaluated together, as many at a time as fit into the fast memory.

        Args:
            x1: ``(d + 1, N)`` inputs as ``network.with_ones`` makes them.
            target: ``(k, N)``.
        """
        errors = torch.empty(len(self), dtype=target.dtype, device=target.device)
        samples = target.shape[1]
        fast = CACHE_BYTES if target.device.type == "cpu" else GPU_BYTES
        order = torch.argsort(self.sizes)
        sizes = self.sizes[order].tolist()
        same = sizes[0] == sizes[-1]
        start = 0
        while start < len(self):
            at_once = max(1, fast // (max(sizes[start], 1) * samples * target.element_size()))
            end = min(start + at_once, len(self))
            rows = slice(start, end) if same else order[start:end]
            neurons = sizes[end - 1]
            said = activations(self.hidden[rows, :neurons], x1)
            miss = torch.baddbmm(self.bias[rows, :, None], self.output[rows, :, :neurons], said).sub_(target)
            errors[rows] = torch.linalg.vector_norm(miss.flatten(1), dim=1).square_()
            start = end
        return errors / samples


def uniform(shape: tuple[int, ...], generator: torch.Generator, device: torch.device, dtype: torch.dtype) -> Tensor:
    """Numbers drawn evenly from -1 to 1."""
    return torch.rand(shape, generator=generator, device=device, dtype=dtype).mul_(2.0).sub_(1.0)


def generator_for(seed: int, generation: int, device: torch.device) -> torch.Generator:
    """The source of chance of one generation.

    Each generation has its own, so that an evolution that was interrupted goes on as if nothing had happened.
    """
    mixed = int(np.random.SeedSequence([seed, generation]).generate_state(1, np.uint64)[0] >> np.uint64(1))
    return torch.Generator(device=device).manual_seed(mixed)
