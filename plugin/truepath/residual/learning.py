"""From samples to networks: scaling, evolution, gradient training; one network, or an ensemble over folds."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from threading import Event

import numpy as np
from threadpoolctl import threadpool_limits

from truepath.lie import Array
from truepath.residual.ensemble import NetworkResidual
from truepath.residual.evolution import State, evolve
from truepath.residual.network import Network, one_thread
from truepath.residual.options import Options
from truepath.residual.reach import Reach
from truepath.residual.samples import Samples
from truepath.residual.training import train
from truepath.splits import random_parts

LEAST_SCALE = 1e-12
VALIDATION_PARTS = 6  # one of which decides when the training of a single network stops
FEWEST_POSES = 30

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Lesson:
    """What one network is to learn.

    Attributes:
        x: ``(N, d)`` scaled inputs.
        target: ``(N, k)`` scaled outputs.
        validation: ``(N,)`` True for samples that only decide when to stop.
        seed: of its evolution.
    """

    x: Array
    target: Array
    validation: Array
    seed: int


def learn_network(
    lesson: Lesson, options: Options, report: Callable[[State], None] = lambda _: None, threads: int = 1
) -> Network:
    """A network by evolution and gradient training; from a checkpoint, where there is one that has it."""
    seen = ~lesson.validation
    desk = options.checkpoint
    key = "" if desk is None else desk.key(lesson, options)
    if desk is not None and (finished := desk.finished(key, lesson, options)) is not None:
        return finished

    def observe(state: State) -> None:
        report(state)
        if desk is not None:
            desk.keep_state(key, state)

    with one_thread():
        state = evolve(
            lesson.x[seen],
            lesson.target[seen],
            options.evolution,
            lesson.seed,
            device=options.device,
            threads=threads,
            start=None if desk is None else desk.state(key, lesson, options),
            observe=observe,
        )
        trained = train(
            state.network, lesson.x, lesson.target, lesson.validation, limits=options.limits, device=options.device
        )
    if desk is not None:
        desk.keep_network(key, trained.network)
    return trained.network


@threadpool_limits.wrap(limits=1)  # else the first one to be done gives the threads back to the others too
def learn_networks(
    lessons: Sequence[Lesson], options: Options, title: str, progress: Progress = lambda _: None
) -> list[Network]:
    """Several networks, on all cores."""
    finished, stop = 0, Event()

    def one(lesson: Lesson) -> Network:
        nonlocal finished

        def report(state: State) -> None:
            if stop.is_set():
                raise CancelledError
            progress(f"{title}: network {finished + 1} of {len(lessons)}, generation {state.generation}")

        network = learn_network(lesson, options, report, threads)
        finished += 1
        return network

    cores = 1 if options.device != "cpu" else os.cpu_count() or 1
    workers = min(len(lessons), cores)
    threads = cores // max(workers, 1)
    progress(f"{title}: first generation (compiled when this is first used: some ten seconds)")
    with ThreadPoolExecutor(workers) as pool:
        futures = [pool.submit(one, lesson) for lesson in lessons]
        try:
            for future in as_completed(futures):  # so that a fault in any of them is known at once
                future.result()
        except BaseException:  # Ctrl-C above all: the other networks shall not go on for long
            stop.set()
            for future in futures:
                future.cancel()
            raise
    return [future.result() for future in futures]


@dataclass(frozen=True, eq=False)
class Scaling:
    """Units in which networks see joints and misses, from the poses that they are to learn from."""

    reach: Reach
    scale: Array

    @classmethod
    def of(cls, samples: Samples) -> Scaling:
        kinds = np.split(samples.miss, range(3, samples.miss.shape[1], 3), axis=1)  # positions; turns
        sizes = [max(float(np.sqrt(np.mean(kind**2))), LEAST_SCALE) for kind in kinds]
        return cls(Reach.of(samples.q_rad), np.repeat(sizes, 3))

    def lesson(self, samples: Samples, validation_rows: Array, seed: int) -> Lesson:
        validation = np.isin(np.arange(len(samples)), validation_rows)
        return Lesson(self.reach.scaled(samples.q_rad), samples.miss / self.scale, validation, seed)

    def residual(self, networks: Sequence[Network]) -> NetworkResidual:
        return NetworkResidual(tuple(networks), self.scale, self.reach)


def learn_ensemble(
    samples: Samples, options: Options, title: str = "network", progress: Progress = lambda _: None
) -> NetworkResidual:
    """Networks that each leave another part of the poses out, by which their training stops."""
    scaling = Scaling.of(samples)
    lessons = [
        scaling.lesson(samples, validation, options.seed + number)
        for number, validation in enumerate(random_parts(samples.visits, options.members, options.seed))
    ]
    return scaling.residual(learn_networks(lessons, options, title, progress))


def learn_for_each(
    parts: Sequence[Samples], options: Options, title: str, progress: Progress = lambda _: None
) -> list[NetworkResidual]:
    """A single network for each of several sets of samples."""
    scalings, lessons = [], []
    for number, samples in enumerate(parts):
        validation = random_parts(samples.visits, VALIDATION_PARTS, options.seed + number)[0]
        scalings.append(Scaling.of(samples))
        lessons.append(scalings[-1].lesson(samples, validation, options.seed + number))
    networks = learn_networks(lessons, options, title, progress)
    return [scaling.residual([network]) for scaling, network in zip(scalings, networks, strict=True)]
