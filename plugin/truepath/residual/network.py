"""The network of the paper: inputs, one hidden layer of logistic neurons, a few linear outputs (eq. 12 to 14)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import torch

from truepath.lie import Array

Tensor = torch.Tensor


@dataclass(frozen=True, eq=False)
class Network:
    """One network of d inputs, l hidden neurons and k outputs.

    The paper speaks of thresholds but its eq. 12 and 14 have none; its eq. 18 counts them, and so does this.

    Attributes:
        hidden: ``(l, d + 1)`` weights of the inputs and, last, the threshold of each neuron.
        output: ``(k, l)`` weights of the neurons.
        bias: ``(k,)`` thresholds of the outputs.
    """

    hidden: Array
    output: Array
    bias: Array

    @property
    def neurons(self) -> int:
        return len(self.hidden)

    def __call__(self, x: Array) -> Array:
        """``(N, k)`` outputs for scaled inputs ``(N, d)``."""
        return outputs([self], x)[0]


def with_ones(x: Tensor) -> Tensor:
    """``(d + 1, N)`` inputs ``(N, d)`` column by column, above the ones that the thresholds are multiplied with."""
    return torch.cat([x.T, torch.ones_like(x[:, :1]).T]).contiguous()


def activations(hidden: Tensor, x1: Tensor) -> Tensor:
    """``(P, l, N)`` what the hidden neurons of P networks say (eq. 12, with 1 / (1 + exp(-x)) for its eq. 13).

    Args:
        hidden: ``(P, l, d + 1)``.
        x1: ``(d + 1, N)`` as ``with_ones`` makes it.
    """
    networks, neurons, _ = hidden.shape
    # One product for all networks: they share their inputs.
    return torch.sigmoid_(hidden.reshape(networks * neurons, -1) @ x1).view(networks, neurons, -1)


def forward(hidden: Tensor, output: Tensor, bias: Tensor, x1: Tensor) -> Tensor:
    """``(P, k, N)`` outputs of P networks (eq. 14).

    Neurons whose output weights are zero take no part: that is how networks of different size are padded.

    Args:
        hidden, output, bias: ``(P, l, d + 1)``, ``(P, k, l)``, ``(P, k)``.
        x1: ``(d + 1, N)`` as ``with_ones`` makes it.
    """
    return torch.baddbmm(bias[:, :, None], output, activations(hidden, x1))


def stacked(networks: Sequence[Network], room: int) -> tuple[Tensor, Tensor, Tensor]:
    """``hidden (P, room, d + 1)``, ``output (P, k, room)``, ``bias (P, k)`` of networks, padded with silent neurons."""

    def padded(values: Array, axis: int) -> Array:
        return np.pad(values, [(0, room - count if a == axis else 0) for a, count in enumerate(values.shape)])

    hidden = torch.from_numpy(np.stack([padded(network.hidden, 0) for network in networks]))
    output = torch.from_numpy(np.stack([padded(network.output, 1) for network in networks]))
    return hidden, output, torch.from_numpy(np.stack([network.bias for network in networks]))


def outputs(networks: Sequence[Network], x: Array) -> Array:
    """``(P, N, k)`` outputs of several networks, each of its own size, for the same scaled inputs ``(N, d)``."""
    parts = stacked(networks, max(network.neurons for network in networks))
    x1 = with_ones(torch.from_numpy(np.ascontiguousarray(x, float)))
    return np.swapaxes(forward(*parts, x1).numpy(), 1, 2)


@contextmanager
def one_thread() -> Iterator[None]:
    """Keeps torch, in the calling thread, to one core.

    On matrices of this size a second thread brings little where a core is free, and costs a factor of ten and more
    where none is.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
