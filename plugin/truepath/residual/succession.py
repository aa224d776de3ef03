"""From one generation to the next: mutation, crossover, greedy selection (eq. 19 to 21)."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from truepath.residual.evaluation import a_few_at_a_time
from truepath.residual.limits import Settings
from truepath.residual.network import Tensor
from truepath.residual.population import Population, uniform
from truepath.residual.task import Task


def successors(
    population: Population,
    error: Tensor,
    task: Task,
    settings: Settings,
    generator: torch.Generator,
    threads: int = 1,
) -> tuple[Population, Tensor]:
    """Each individual, or its trial if that is better; and their mean squared errors, ``(P,)``.

    A trial is the best individual with a difference of two others, crossed with the individual itself. Mutation
    (eq. 19) takes the hidden size of the best: what two others have beyond it is disregarded, what they lack is drawn
    at random. Crossover (eq. 20) takes single numbers of the individual where it has them.

    Args:
        error: ``(P,)`` of the population.
        task: what they are to learn.
        threads: at most so many, on a CPU; the result does not depend on their number.
    """
    if task.target.device.type == "cpu":
        return _on_cpu(population, error, task, settings, generator, threads)
    return _on_gpu(population, error, task, settings, generator)


def _on_cpu(
    population: Population,
    error: Tensor,
    task: Task,
    settings: Settings,
    generator: torch.Generator,
    threads: int = 1,
) -> tuple[Population, Tensor]:
    """Whoever evaluates a trial makes it and decides about it, so that all threads have their share of everything."""
    from truepath.residual import compiled

    limits, blocks = torch.iinfo(torch.int64), task.blocks
    seeds = torch.randint(limits.min, limits.max, (len(population),), generator=generator).numpy().view(np.uint64)
    own = [t.contiguous().numpy() for t in (population.genes, population.bias, population.sizes, error)]
    genes, bias, sizes, errors = own
    best = int(errors.argmin())
    precision: Any = genes.dtype.type
    chance = best, precision(settings.factor), settings.crossover, seeds
    trial, trial_bias, trial_error = (np.empty_like(part) for part in (genes, bias, errors))
    trial_sizes = np.full_like(sizes, sizes[best])
    misses = compiled.misses(blocks.inputs, blocks.outputs, precision)

    def succeed(start: int, stop: int) -> None:
        compiled.make_trials(genes, bias, sizes, *chance, trial, trial_bias, start, stop)
        misses(trial, trial_bias, trial_sizes, blocks.x, blocks.target, blocks.poses, trial_error, start, stop)
        trial_error[start:stop] /= blocks.poses
        compiled.select(*own, trial, trial_bias, trial_sizes, trial_error, start, stop)

    a_few_at_a_time(succeed, len(population), threads)
    return Population(*map(torch.from_numpy, (trial, trial_bias, trial_sizes))), torch.from_numpy(trial_error)


def _on_gpu(
    population: Population, error: Tensor, task: Task, settings: Settings, generator: torch.Generator
) -> tuple[Population, Tensor]:
    trial = _trials(population, int(torch.argmin(error)), settings, generator)
    errors = trial.mean_squared_error(task.x1, task.target)
    better = errors < error
    return population.where(better, trial), torch.where(better, errors, error)


def _trials(population: Population, best: int, settings: Settings, generator: torch.Generator) -> Population:
    count, room = len(population), population.room
    size, device = int(population.sizes[best]), population.sizes.device
    a = torch.randint(count, (count,), generator=generator, device=device)
    b = (a + torch.randint(1, count, (count,), generator=generator, device=device)) % count
    genes, bias, lacks = population.genes[:, :size], population.bias, ~population.has()[:, :size]
    difference = _unified(genes, lacks, a, generator).sub_(_unified(genes, lacks, b, generator))
    mutant = torch.add(genes[best], difference, alpha=settings.factor)
    mutant_bias = torch.add(bias[best], bias[a] - bias[b], alpha=settings.factor)
    keep, keep_bias = (
        torch.rand(own.shape, generator=generator, device=device) > settings.crossover for own in (genes, bias)
    )
    if lacks.any():
        keep[lacks] = False
    return Population(
        torch.nn.functional.pad(torch.where(keep, genes, mutant), (0, 0, 0, room - size)),
        torch.where(keep_bias, bias, mutant_bias),
        torch.full_like(population.sizes, size),
    )


def _unified(genes: Tensor, lacks: Tensor, who: Tensor, generator: torch.Generator) -> Tensor:
    """The genes of some individuals in the length of the best: random where an individual has none."""
    unified, missing = genes.index_select(0, who), lacks.index_select(0, who)
    count = int(missing.sum())
    if count:
        unified[missing] = uniform((count, genes.shape[2]), generator, genes.device, genes.dtype)
    return unified
