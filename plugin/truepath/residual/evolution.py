"""Differential evolution over networks of different hidden size (eq. 18 to 22 of the paper; Noman, Iba 2008)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch

from truepath.lie import Array
from truepath.residual.limits import Settings
from truepath.residual.network import Network, Tensor
from truepath.residual.population import Population, generator_for, uniform
from truepath.residual.succession import successors
from truepath.residual.task import Task

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
    task = Task.of(x, target, device)
    state = first_generation(task, settings, seed, threads) if start is None else start
    while not has_ended(state, settings):
        state = next_generation(state, task, settings, seed, threads)
        observe(state)
    return state


def has_ended(state: State, settings: Settings) -> bool:
    """By target, by number of generations, or because nothing happens any more."""
    return (
        state.best_error <= settings.target
        or state.generation >= settings.generations
        or state.stale >= settings.stagnation
    )


def first_generation(task: Task, settings: Settings, seed: int, threads: int = 1) -> State:
    """Random networks of all hidden sizes."""
    x1, target = task.x1, task.target
    generator = generator_for(seed, 0, x1.device)
    sizes = torch.randint(
        settings.smallest, settings.largest + 1, (settings.individuals,), generator=generator, device=x1.device
    )
    population = Population.random(sizes, settings.largest, len(x1) - 1, len(target), generator, dtype=target.dtype)
    error = population.mean_squared_error(x1, target, threads)
    return State(population, error, generation=0, stale=0, reference=float(error.min()))


def next_generation(state: State, task: Task, settings: Settings, seed: int, threads: int = 1) -> State:
    """Mutation, crossover, greedy selection; from time to time the hidden sizes step."""
    generation = state.generation + 1
    generator = generator_for(seed, generation, task.x1.device)
    population, error = successors(state.population, state.error, task, settings, generator, threads)
    best = float(error.min())
    if best > settings.target and generation % settings.sizes_every == 0:
        population, changed = stepped(population, int(torch.argmin(error)), settings, generator)
        error = torch.where(changed, population.mean_squared_error(task.x1, task.target, threads), error)
    fell = best < (1.0 - WORTH_MENTIONING) * state.reference
    return State(population, error, generation, 0 if fell else state.stale + 1, best if fell else state.reference)


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
