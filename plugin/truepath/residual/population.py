"""Many networks of different hidden size as a few tensors, so that all of them are evaluated at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from truepath.residual import evaluation
from truepath.residual.network import Network, Tensor, activations, stacked

GPU_BYTES = 1 << 30  # activations of so many networks at a time

Rows = slice | Tensor


@dataclass(frozen=True, eq=False)
class Population:
    """P networks of d inputs and k outputs, padded to the same number L of hidden neurons.

    Attributes:
        genes: ``(P, L, d + 1 + k)`` neuron by neuron as in eq. 18: input weights, threshold, output weights; the last
            are zero for neurons that a network does not have.
        bias: ``(P, k)``.
        sizes: ``(P,)`` number of hidden neurons of each.
    """

    genes: Tensor
    bias: Tensor
    sizes: Tensor

    def __len__(self) -> int:
        return len(self.sizes)

    @property
    def room(self) -> int:
        """Most hidden neurons that a network of this population can have."""
        return self.genes.shape[1]

    @property
    def hidden(self) -> Tensor:
        """``(P, L, d + 1)``, a view."""
        return self.genes[..., : -self.bias.shape[1]]

    @property
    def output(self) -> Tensor:
        """``(P, k, L)``, a view."""
        return self.genes[..., -self.bias.shape[1] :].mT

    @classmethod
    def random(
        cls, sizes: Tensor, room: int, inputs: int, outputs: int, generator: torch.Generator, dtype: torch.dtype
    ) -> Population:
        """Networks of those sizes with all weights drawn from -1 to 1, as in the paper's figure 5."""
        count, device = len(sizes), sizes.device
        genes = uniform((count, room, inputs + 1 + outputs), generator, device, dtype)
        return cls(genes, uniform((count, outputs), generator, device, dtype), sizes).trimmed()

    @classmethod
    def of(cls, networks: Sequence[Network], room: int, device: torch.device, dtype: torch.dtype) -> Population:
        """Given networks."""
        hidden, output, bias = stacked(networks, room)
        sizes = torch.tensor([network.neurons for network in networks], device=device)
        return cls(torch.cat([hidden, output.mT], dim=2).to(device, dtype), bias.to(device, dtype), sizes)

    def has(self) -> Tensor:
        """``(P, L)`` True for the neurons that a network has."""
        return torch.arange(self.room, device=self.sizes.device) < self.sizes[:, None]

    def trimmed(self) -> Population:
        """Neurons that a network does not have made silent."""
        output = (self.output * self.has()[:, None]).mT
        return replace(self, genes=torch.cat([self.hidden, output], dim=2))

    def network(self, number: int) -> Network:
        """One of them, without the padding."""
        size = int(self.sizes[number])
        parts = (self.hidden[number, :size], self.output[number, :, :size], self.bias[number])
        return Network(*(part.double().contiguous().cpu().numpy() for part in parts))

    def where(self, chosen: Tensor, other: Population) -> Population:
        """The other's networks where ``chosen`` ``(P,)``, else these."""
        rows = chosen.nonzero()[:, 0]
        pairs = (self.genes, other.genes), (self.bias, other.bias), (self.sizes, other.sizes)
        return Population(*(own.index_copy(0, rows, theirs.index_select(0, rows)) for own, theirs in pairs))

    def mean_squared_error(self, x1: Tensor, target: Tensor, threads: int = 1) -> Tensor:
        """``(P,)`` squared miss per sample, averaged over the samples (eq. 15).

        Args:
            x1: ``(d + 1, N)`` inputs as ``network.with_ones`` makes them.
            target: ``(k, N)``.
            threads: at most so many, on a CPU; the result does not depend on their number.
        """
        if target.device.type == "cpu":
            return self._squares_on_cpu(x1, target, threads) / target.shape[1]
        return self._squares_on_gpu(x1, target) / target.shape[1]

    def _squares_on_gpu(self, x1: Tensor, target: Tensor) -> Tensor:
        squares = torch.empty(len(self), dtype=target.dtype, device=target.device)
        for rows, neurons in self._groups(GPU_BYTES, target):
            said = activations(self.hidden[rows, :neurons], x1)
            miss = torch.baddbmm(self.bias[rows, :, None], self.output[rows, :, :neurons], said).sub_(target)
            squares[rows] = torch.linalg.vector_norm(miss.flatten(1), dim=1).square_()
        return squares

    def _squares_on_cpu(self, x1: Tensor, target: Tensor, threads: int) -> Tensor:
        genes, bias, sizes, given, wanted = (t.numpy() for t in (self.genes, self.bias, self.sizes, x1, target))
        return torch.from_numpy(evaluation.squared_misses(genes, bias, sizes, given, wanted, threads))

    def _groups(self, fast: int, target: Tensor) -> Iterator[tuple[Rows, int]]:
        """Networks of like size, and the largest such: as many as leave their activations in so many fast bytes."""
        sizes, order = self.sizes.tolist(), None
        if min(sizes) != max(sizes):
            order = torch.argsort(self.sizes, stable=True)
            sizes = self.sizes[order].tolist()
        start = 0
        while start < len(self):
            at_once = max(1, fast // (max(sizes[start], 1) * target.shape[1] * target.element_size()))
            end = min(start + at_once, len(self))
            yield slice(start, end) if order is None else order[start:end], sizes[end - 1]
            start = end


def uniform(shape: tuple[int, ...], generator: torch.Generator, device: torch.device, dtype: torch.dtype) -> Tensor:
    """Numbers drawn evenly from -1 to 1."""
    return torch.rand(shape, generator=generator, device=device, dtype=dtype).mul_(2.0).sub_(1.0)


def generator_for(seed: int, generation: int, device: torch.device) -> torch.Generator:
    """The source of chance of one generation.

    Each generation has its own, so that an evolution that was interrupted goes on as if nothing had happened.
    """
    mixed = int(np.random.SeedSequence([seed, generation]).generate_state(1, np.uint64)[0] >> np.uint64(1))
    return torch.Generator(device=device).manual_seed(mixed)
