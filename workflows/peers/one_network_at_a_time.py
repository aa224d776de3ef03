"""Differential evolution as the paper's equations say it, one network after the other: the peer of the batched one.

Two of them, both in single precision: with torch, as people write it, and with numpy, whose calls cost less on small
arrays. A network is one vector (eq. 18): neuron by neuron its input weights, its threshold, its output weights; then
the thresholds of the outputs. Nothing of truepath is used.
"""

from __future__ import annotations

import numpy as np
import torch

FACTOR, CROSSOVER = 0.5, 0.9


class WithNumpy:
    """One generation: mutation, crossover, evaluation, selection, in a loop over the individuals."""

    def __init__(self, x: np.ndarray, target: np.ndarray, vectors: list[np.ndarray], seed: int) -> None:
        self.x1 = np.column_stack([x, np.ones(len(x))]).astype(np.float32)
        self.target = target.astype(np.float32)
        self.inputs, self.outputs = x.shape[1], target.shape[1]
        self.per_neuron = self.inputs + 1 + self.outputs
        self.vectors = [vector.astype(np.float32) for vector in vectors]
        self.rng = np.random.default_rng(seed)
        self.errors = [self.error(vector) for vector in self.vectors]

    def error(self, vector: np.ndarray) -> float:
        neurons = vector[: -self.outputs].reshape(-1, self.per_neuron)
        hidden = 1.0 / (1.0 + np.exp(-(self.x1 @ neurons[:, : self.inputs + 1].T)))
        miss = hidden @ neurons[:, self.inputs + 1 :] + vector[-self.outputs :] - self.target
        return float(np.vdot(miss, miss)) / len(self.x1)

    def in_length(self, vector: np.ndarray, length: int) -> np.ndarray:
        """Longer: what exceeds is disregarded; shorter: what is missing is random."""
        weights, thresholds = vector[: -self.outputs], vector[-self.outputs :]
        missing = length - len(vector)
        if missing > 0:
            weights = np.concatenate([weights, self.rng.uniform(-1, 1, missing).astype(np.float32)])
        return np.concatenate([weights[: length - self.outputs], thresholds])

    def generation(self) -> None:
        best = self.vectors[int(np.argmin(self.errors))]
        for i, own in enumerate(self.vectors):
            a, b = self.rng.choice(len(self.vectors), 2, replace=False)
            difference = self.in_length(self.vectors[a], len(best)) - self.in_length(self.vectors[b], len(best))
            mutant = best + np.float32(FACTOR) * difference
            keep = self.rng.random(len(best)) > CROSSOVER
            trial = np.where(keep, self.in_length(own, len(best)), mutant)
            error = self.error(trial)
            if error < self.errors[i]:
                self.vectors[i], self.errors[i] = trial, error


class WithTorch:
    """The same with torch tensors."""

    def __init__(self, x: np.ndarray, target: np.ndarray, vectors: list[np.ndarray], seed: int) -> None:
        self.x = torch.tensor(x, dtype=torch.float32)
        self.target = torch.tensor(target, dtype=torch.float32)
        self.inputs, self.outputs = x.shape[1], target.shape[1]
        self.per_neuron = self.inputs + 1 + self.outputs
        self.vectors = [torch.tensor(vector, dtype=torch.float32) for vector in vectors]
        self.generator = torch.Generator().manual_seed(seed)
        self.errors = [self.error(vector) for vector in self.vectors]

    def error(self, vector: torch.Tensor) -> float:
        neurons = vector[: -self.outputs].view(-1, self.per_neuron)
        weights, thresholds = neurons[:, : self.inputs], neurons[:, self.inputs]
        hidden = torch.sigmoid(torch.nn.functional.linear(self.x, weights, thresholds))
        said = torch.nn.functional.linear(hidden, neurons[:, self.inputs + 1 :].T, vector[-self.outputs :])
        return float(torch.nn.functional.mse_loss(said, self.target))

    def in_length(self, vector: torch.Tensor, length: int) -> torch.Tensor:
        weights, thresholds = vector[: -self.outputs], vector[-self.outputs :]
        missing = length - len(vector)
        if missing > 0:
            weights = torch.cat([weights, torch.rand(missing, generator=self.generator) * 2 - 1])
        return torch.cat([weights[: length - self.outputs], thresholds])

    def generation(self) -> None:
        best = self.vectors[min(range(len(self.errors)), key=self.errors.__getitem__)]
        for i, own in enumerate(self.vectors):
            a, b = torch.randperm(len(self.vectors), generator=self.generator)[:2].tolist()
            difference = self.in_length(self.vectors[a], len(best)) - self.in_length(self.vectors[b], len(best))
            mutant = best + FACTOR * difference
            keep = torch.rand(len(best), generator=self.generator) > CROSSOVER
            trial = torch.where(keep, self.in_length(own, len(best)), mutant)
            error = self.error(trial)
            if error < self.errors[i]:
                self.vectors[i], self.errors[i] = trial, error
