"""Gradient training from a start: Levenberg-Marquardt with learnt weight decay, stopped by a validation part.

The paper updates by plain gradient descent (eq. 16, 17). Of Adam, L-BFGS and Levenberg-Marquardt the last one proved
best (``workflows/does_evolution_pay.py``). How strongly weights are held small is learnt from the data while it runs
(MacKay 1992; Foresee, Hagan 1997).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from truepath.lie import Array
from truepath.residual.limits import Limits
from truepath.residual.network import Network, Tensor, activations, with_ones

FIRST_DAMPING, LEAST_DAMPING, MOST_TRIES = 1e-2, 1e-12, 12
EASIER, HARDER = 0.2, 4.0
FIRST_DECAY = 1e-2
LEAST_DECAY, MOST_DECAY = 1e-8, 1e8
WORTH_MENTIONING = 1e-4  # of the validation error


@dataclass(frozen=True, eq=False)
class Trained:
    """A network, its root mean square misses (of scaled outputs) where it was trained and where validated."""

    network: Network
    error: float
    validation_error: float
    iterations: int


def train(
    start: Network,
    x: Array,
    target: Array,
    validation: Array,
    *,
    limits: Limits | None = None,
    device: str = "cpu",
) -> Trained:
    """Trains a network from its present weights.

    Args:
        start: where to begin.
        x: ``(N, d)`` scaled inputs.
        target: ``(N, k)`` scaled outputs.
        validation: ``(N,)`` True for samples that only decide when to stop.
        limits: when to stop at the latest.
        device: ``cpu`` or ``cuda``.
    """
    limits = limits or Limits()
    seen = ~validation
    fit = _Fit(start, x[seen], target[seen], torch.device(device))
    check = _Fit(start, x[validation], target[validation], torch.device(device)) if validation.any() else fit
    best, best_error, stale, iteration = fit.weights, check.rms(fit.weights), 0, 0
    for iteration in range(1, limits.iterations + 1):  # noqa: B007
        if not fit.step():
            break
        error = check.rms(fit.weights)
        stale += 1
        if error < best_error * (1.0 - WORTH_MENTIONING):
            best, best_error, stale = fit.weights, error, 0
        if stale >= limits.patience:
            break
    return Trained(fit.network(best), fit.rms(best), best_error, iteration)


class _Fit:
    """The state of a training. Weights are one vector: hidden ``(l, d + 1)``, then outputs ``(k, l + 1)``."""

    def __init__(self, start: Network, x: Array, target: Array, device: torch.device) -> None:
        self.neurons, self.inputs = start.neurons, start.hidden.shape[1]
        self.outputs = len(start.bias)
        self.x1 = with_ones(torch.tensor(x, dtype=torch.float64, device=device))
        self.target = torch.tensor(np.ascontiguousarray(target.T), device=device)
        vector = np.concatenate([start.hidden.ravel(), np.c_[start.output, start.bias].ravel()])
        self.weights = torch.tensor(vector, device=device)
        group = np.zeros(len(vector), int)  # of weights that are held small alike
        group[: self.neurons * self.inputs].reshape(self.neurons, -1)[:, -1] = 1
        kind = np.arange(self.outputs) // 3  # positions and turns: of one there may be much to learn, of the other none
        kinds = int(kind[-1]) + 1
        group[self.neurons * self.inputs :].reshape(self.outputs, -1)[:] = 3 + kind[:, None]
        group[self.neurons * self.inputs :].reshape(self.outputs, -1)[:, -1] = 2
        self.group, self.kind = torch.tensor(group, device=device), torch.tensor(kind, device=device)
        self.decay = torch.full((3 + kinds,), FIRST_DECAY, device=device, dtype=torch.float64)
        self.decay[2] = LEAST_DECAY  # the thresholds of the outputs are free
        self.precision = torch.ones(kinds, dtype=torch.float64, device=device)
        if self.target.numel() > 1:
            for number in range(kinds):
                self.precision[number] = 1.0 / max(float(self.target[self.kind == number].var()), 1e-300)
        self.damping = FIRST_DAMPING

    def split(self, weights: Tensor) -> tuple[Tensor, Tensor]:
        """Hidden ``(l, d + 1)`` and outputs ``(k, l + 1)``."""
        count = self.neurons * self.inputs
        return weights[:count].view(self.neurons, self.inputs), weights[count:].view(self.outputs, -1)

    def network(self, weights: Tensor) -> Network:
        hidden, output = (part.cpu().numpy().copy() for part in self.split(weights))
        return Network(hidden, output[:, :-1].copy(), output[:, -1].copy())

    def miss(self, weights: Tensor) -> tuple[Tensor, Tensor]:
        """Outputs less target ``(k, N)``, and the hidden neurons with a row of ones ``(l + 1, N)``."""
        hidden, output = self.split(weights)
        said = activations(hidden[None], self.x1)[0]
        said1 = torch.cat([said, torch.ones_like(self.x1[:1])])
        return output @ said1 - self.target, said1

    def rms(self, weights: Tensor) -> float:
        miss = self.miss(weights)[0]
        return float(torch.linalg.vector_norm(miss) / max(miss.numel(), 1) ** 0.5)

    def step(self) -> bool:
        """One step of Levenberg-Marquardt, and new sizes of noise and weights; False where no step helps."""
        miss, said1 = self.miss(self.weights)
        normal, gradient = self._normal_equations(miss, said1)
        decay = self.decay[self.group]
        matrix = normal + torch.diag(decay)
        slope = gradient + decay * self.weights
        before = self._cost(miss, self.weights, decay)
        scale = torch.diag(matrix)
        for _ in range(MOST_TRIES):
            step, info = torch.linalg.solve_ex(matrix + torch.diag(self.damping * scale), slope)
            if int(info) == 0:
                weights = self.weights - step
                miss = self.miss(weights)[0]
                if float(self._cost(miss, weights, decay)) < float(before):
                    break
            self.damping *= HARDER
        else:
            return False
        self.weights, self.damping = weights, max(self.damping * EASIER, LEAST_DAMPING)
        self._learn_sizes(matrix, miss)
        return True

    def _cost(self, miss: Tensor, weights: Tensor, decay: Tensor) -> Tensor:
        return 0.5 * (self._precision_of_outputs() @ miss.square().sum(1)) + 0.5 * (decay * weights.square()).sum()

    def _precision_of_outputs(self) -> Tensor:
        """``(k,)``."""
        return self.precision[self.kind]

    def _normal_equations(self, miss: Tensor, said1: Tensor) -> tuple[Tensor, Tensor]:
        """J' P J and J' P r without J, for P the precision of each output.

        d output_k / d hidden_ji = V_kj s_j (1 - s_j) x_i: the outputs share all but the factor V_kj, so the products
        over the samples are needed once and not for every output.
        """
        output, precision = self.split(self.weights)[1], self._precision_of_outputs()[:, None]
        V, said = output[:, :-1], said1[:-1]
        slopes = ((said * (1.0 - said))[:, None] * self.x1).reshape(-1, self.x1.shape[1])  # (l (d + 1), N)
        each = V.repeat_interleave(self.inputs, dim=1)  # (k, l (d + 1))
        count, rest = len(slopes), output.numel()
        normal = torch.empty(count + rest, count + rest, dtype=slopes.dtype, device=slopes.device)
        normal[:count, :count] = (slopes @ slopes.T) * (each.T @ (precision * each))
        across = (slopes @ said1.T)[:, None] * (precision * each).T[:, :, None]
        normal[:count, count:] = across.reshape(count, rest)
        normal[count:, :count] = normal[:count, count:].T
        squares, miss = said1 @ said1.T, precision * miss
        normal[count:, count:] = torch.block_diag(*[each_output * squares for each_output in precision])
        return normal, torch.cat(
            [(slopes * (V.T @ miss).repeat_interleave(self.inputs, dim=0)).sum(1), (miss @ said1.T).ravel()]
        )

    def _learn_sizes(self, matrix: Tensor, miss: Tensor) -> None:
        """MacKay's updates: sizes of weights, group by group, and of what is left."""
        factor, info = torch.linalg.cholesky_ex(matrix)
        if int(info) != 0:
            return
        known = 1.0 - self.decay[self.group] * torch.diag(torch.cholesky_inverse(factor))  # 0 to 1: how well, by data
        for group in (0, 1, *range(3, len(self.decay))):
            mine = self.group == group
            square = float(self.weights[mine].square().sum())
            self.decay[group] = min(max(float(known[mine].sum()) / max(square, 1e-12), LEAST_DECAY), MOST_DECAY)
        of_neuron = self.split(known)[0].sum(1)
        heard = self._precision_of_outputs()[:, None] * self.split(self.weights)[1][:, :-1].square()
        for kind in range(len(self.precision)):
            mine = self.kind == kind
            # What is known of a neuron is known by those outputs that hear it.
            share = heard[mine].sum(0) / heard.sum(0).clamp(min=1e-300)
            well_determined = float(
                known[self.group == 3 + kind].sum().clamp(min=0.0) + (share @ of_neuron).clamp(min=0.0)
            )
            left = max(miss[mine].numel() - well_determined - int(mine.sum()), 1.0)
            self.precision[kind] = left / max(float(miss[mine].square().sum()), 1e-300)
