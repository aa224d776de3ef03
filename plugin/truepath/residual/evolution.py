"""Differential evolution over networks of different hidden size (eq. 18 to 22 of the paper; Noman, Iba 2008)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch

from truepath.lie import Array
from truepath.residual.limits import Settings
from truepath.residual.network import Network, Tensor, with_ones
from truepath.residual.population import Make, Population, generator_for, uniform

WORTH_MENTIONING = 1e-3  # of the error


@dataclass(frozen=True, eq=False)
class State:
    """Where an evolution stands; it goes on from here as if it had never stopped.

    Attributes:
        population: all individuals.
        error: ``(P,)`` mean squared error of each.
        generation: how many there have been.
        stale: how many since the error fell last.
        reference: the best error at that time.
    """

    population: Population
    error: Tensor
    generation: int
    stale: int
    reference: float

    @property
    def best(self) -> int:
        return int(torch.argmin(self.error))

    @property
    def best_error(self) -> float:
        return float(self.error.min())

    @property
    def network(self) -> Network:
        """The best individual."""
        return self.population.network(self.best)


Observer = Callable[[State], None]


def evolve(
    x: Array,
    target: Array,
    settings: Settings,
    seed: int,
    *,
    device: str = "cpu",
    threads: int = 1,
    start: State | None = None,
    observe: Observer = lambda _: None,
) -> State:
    """Evolves networks from ``x`` to ``target``; the same for the same seed, however often it was interrupted.

    Args:
        x: ``(N, d)`` inputs, scaled to about -1 to 1.
        target: ``(N, k)`` outputs, scaled to about one.
        device: ``cpu`` or ``cuda``.
        threads: on which networks are evaluated, at most; the result does not depend on their number.
        start: where an earlier run was interrupted.
        observe: told about each generation.
    """
    where = torch.device(device)
    x1 = with_ones(torch.tensor(x, dtype=torch.float32, device=where))
    wanted = torch.tensor(np.ascontiguousarray(target.T), dtype=torch.float32, device=where)
    state = first_generation(x1, wanted, settings, seed, threads) if start is None else start
    while not has_ended(state, settings):
        state = next_generation(state, x1, wanted, settings, seed, threads)
        observe(state)
    return state


def has_ended(state: State, settings: Settings) -> bool:
    """By target, by number of generations, or because nothing happens any more."""
    return (
        state.best_error <= settings.target
        or state.generation >= settings.generations
        or state.stale >= settings.stagnation
    )


def first_generation(x1: Tensor, target: Tensor, settings: Settings, seed: int, threads: int = 1) -> State:
    """Random networks of all hidden sizes."""
    generator = generator_for(seed, 0, x1.device)
    sizes = torch.randint(
        settings.smallest, settings.largest + 1, (settings.individuals,), generator=generator, device=x1.device
    )
    population = Population.random(sizes, settings.largest, len(x1) - 1, len(target), generator, dtype=target.dtype)
    error = population.mean_squared_error(x1, target, threads)
    return State(population, error, generation=0, stale=0, reference=float(error.min()))


def next_generation(state: State, x1: Tensor, target: Tensor, settings: Settings, seed: int, threads: int = 1) -> State:
    """Mutation, crossover, greedy selection; from time to time the hidden sizes step."""
    generation = state.generation + 1
    generator = generator_for(seed, generation, x1.device)
    trial, make = _trials_and_maker(state.population, state.best, settings, generator)
    error = trial.mean_squared_error(x1, target, threads, make)
    better = error < state.error  # eq. 21
    population, error = state.population.where(better, trial), torch.where(better, error, state.error)
    best = float(error.min())
    if best > settings.target and generation % settings.sizes_every == 0:
        population, changed = stepped(population, int(torch.argmin(error)), settings, generator)
        error = torch.where(changed, population.mean_squared_error(x1, target, threads), error)
    fell = best < (1.0 - WORTH_MENTIONING) * state.reference
    return State(population, error, generation, 0 if fell else state.stale + 1, best if fell else state.reference)


def trials(population: Population, best: int, settings: Settings, generator: torch.Generator) -> Population:
    """A trial for each individual: the best one with a difference of two others, crossed with the individual itself.

    Mutation (eq. 19) takes the hidden size of the best: what two others have beyond it is disregarded, what they lack
    is drawn at random. Crossover (eq. 20) takes single numbers of the individual where it has them.
    """
    on_cpu = population.sizes.device.type == "cpu"
    return (_trials_on_cpu if on_cpu else _trials_on_gpu)(population, best, settings, generator)


def _trials_and_maker(
    population: Population, best: int, settings: Settings, generator: torch.Generator
) -> tuple[Population, Make | None]:
    """On a CPU whoever evaluates a trial makes it, so that all threads have their share and it is still at hand."""
    if population.sizes.device.type == "cpu":
        return _to_be_made(population, best, settings, generator)
    return _trials_on_gpu(population, best, settings, generator), None


def _trials_on_cpu(population: Population, best: int, settings: Settings, generator: torch.Generator) -> Population:
    trial, make = _to_be_made(population, best, settings, generator)
    make(0, len(trial))
    return trial


def _to_be_made(
    population: Population, best: int, settings: Settings, generator: torch.Generator
) -> tuple[Population, Make]:
    from truepath.residual import compiled

    limits = torch.iinfo(torch.int64)
    seeds = torch.randint(limits.min, limits.max, (len(population),), generator=generator).numpy().view(np.uint64)
    genes, bias, sizes = (part.numpy() for part in (population.genes, population.bias, population.sizes))
    flat, precision = genes.reshape(len(genes), -1), genes.dtype.type
    trial, trial_bias = np.zeros_like(flat), np.empty_like(bias)
    factor, crossover = precision(settings.factor), settings.crossover
    arguments = flat, bias, sizes, genes.shape[2], best, factor, crossover, seeds, trial, trial_bias
    made = Population(
        torch.from_numpy(trial.reshape(genes.shape)),
        torch.from_numpy(trial_bias),
        torch.full_like(population.sizes, int(sizes[best])),
    )
    return made, partial(compiled.trials(), *arguments)


def _trials_on_gpu(population: Population, best: int, settings: Settings, generator: torch.Generator) -> Population:
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


def stepped(
    population: Population, best: int, settings: Settings, generator: torch.Generator
) -> tuple[Population, Tensor]:
    """Hidden sizes stepped towards, and beyond, that of the best (eq. 22); and who has lost a neuron, ``(P,)``.

    A new neuron listens at random and says nothing yet, so that nobody becomes worse by growing.
    """
    sizes = population.sizes
    larger = sizes > sizes[best]
    new = torch.where(larger, sizes - 1, sizes + 1).clamp(settings.smallest, settings.largest)
    fresh = population.has().logical_not()[:, :, None]
    listening = uniform(tuple(population.hidden.shape), generator, sizes.device, population.genes.dtype)
    hidden = torch.where(fresh, listening, population.hidden)
    grown = torch.cat([hidden, population.output.mT], dim=2)
    return replace(population, genes=grown, sizes=new).trimmed(), new < sizes
