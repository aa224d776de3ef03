"""One generation of the evolution, all networks in one go, against one network at a time: a part of benchmark.py.

    .venv/bin/python workflows/generation_benchmark.py [--individuals 200] [--largest 40] [--poses 1000]
        [--device cuda] [--rounds 30]

All evolve from the same individuals, the best of which has as many hidden neurons as there may be (the dearest case:
trials take the size of the best), on the same samples, in single precision, in the same process. ``as_drawn`` is the
same once more with the best that was drawn, of whatever size. A generation is mutation, crossover, evaluation,
selection. Each is timed with one thread and with all cores, a few rounds in turn, the
first of which is not timed; medians over all turns are compared, and of each the quicker number of threads counts.
Prints JSON.

With a GPU, ``share_of_bandwidth`` compares with the time that moving the activations to memory and back once would
take, at the bandwidth that a plain copy reaches on the same device in the same run.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).resolve().parent))  # the peers

INPUTS, OUTPUTS = 6, 3
COPIED = 1 << 28  # numbers
TURNS = 5  # so that nobody has the quiet minutes of a shared machine to himself


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--individuals", type=int, default=200)
    parser.add_argument("--largest", type=int, default=40, help="hidden neurons")
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=30, help="generations timed")
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args(arguments)
    result = measure(options, largest_best=True)
    if options.device == "cpu":
        result["as_drawn"] = measure(options, largest_best=False)
    print(json.dumps(result, allow_nan=False))
    return 0


def measure(options: argparse.Namespace, *, largest_best: bool) -> dict[str, Any]:
    """Seconds per generation, ours and the peers'."""
    from truepath.residual.evolution import Settings, State, first_generation, next_generation
    from truepath.residual.network import one_thread, with_ones

    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (options.poses, INPUTS))
    target = np.column_stack([np.sin(2 * x[:, 0]), x[:, 1] * x[:, 2], np.cos(x[:, 3] + x[:, 4])])
    # No steps of the hidden sizes: the peers have none.
    settings = Settings(options.individuals, 1, options.largest, sizes_every=1 << 30)
    x1 = with_ones(torch.tensor(x, dtype=torch.float32, device=options.device))
    wanted = torch.tensor(target.T.copy(), dtype=torch.float32, device=options.device)
    first = first_generation(x1, wanted, settings, seed=0)
    if largest_best:
        first = _with_a_large_best(first, settings)

    class Ours:
        state: State = first

        threads = 1

        def generation(self) -> None:
            with one_thread():  # for torch, as a run has it; the threads are those of the evaluation
                self.state = next_generation(self.state, x1, wanted, settings, seed=0, threads=self.threads)
            if options.device != "cpu":
                torch.cuda.synchronize()

    result: dict[str, Any] = {
        "individuals": options.individuals,
        "largest": options.largest,
        "poses": options.poses,
        "neurons_of_the_best": int(first.population.sizes[first.best]),
        "device": options.device if options.device == "cpu" else torch.cuda.get_device_name(),
    }
    if options.device != "cpu":
        seconds = statistics.median(_seconds(Ours().generation, options.rounds))
        numbers = options.individuals * result["neurons_of_the_best"] * options.poses
        least = 2 * 4 * numbers / _bandwidth(options.device)
        return {**result, "batched_s": seconds, "least_s": least, "share_of_bandwidth": least / seconds}

    from peers.one_network_at_a_time import WithNumpy, WithTorch

    vectors = [_vector(first.population.network(number)) for number in range(options.individuals)]
    competitors: dict[str, Any] = {
        "batched": Ours(),
        "torch": WithTorch(x, target, vectors, seed=0),
        "numpy": WithNumpy(x, target, vectors, seed=0),
    }
    times = _in_turns(competitors, options.rounds)
    result |= {f"{name}_s": min(by_threads.values()) for name, by_threads in times.items()}
    return {**result, "seconds_by_threads": times}


def _in_turns(competitors: dict[str, Any], rounds: int) -> dict[str, dict[int, float]]:
    """Median seconds of a generation of each, by number of threads."""
    numbers = sorted({1, os.cpu_count() or 1})
    seconds: dict[str, dict[int, list[float]]] = {name: {threads: [] for threads in numbers} for name in competitors}
    for _ in range(TURNS):
        for threads in numbers:
            for name, each in competitors.items():
                each.threads = threads  # ours
                torch.set_num_threads(threads)
                with threadpool_limits(threads, user_api="blas"):
                    seconds[name][threads] += _seconds(each.generation, -(-rounds // TURNS))
    return {name: {n: statistics.median(s) for n, s in by_threads.items()} for name, by_threads in seconds.items()}


def _with_a_large_best(state: Any, settings: Any) -> Any:
    """The same generation after the size of the best has changed places with the largest one."""
    sizes = state.population.sizes.clone()
    largest = int(torch.argmax(sizes))
    sizes[state.best], sizes[largest] = settings.largest, int(sizes[state.best])
    return replace(state, population=replace(state.population, sizes=sizes).trimmed())


def _seconds(generation: Callable[[], None], rounds: int) -> list[float]:
    generation()
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        generation()
        seconds.append(time.perf_counter() - start)
    return seconds


def _vector(network: Any) -> np.ndarray:
    neurons = np.concatenate([network.hidden, network.output.T], axis=1)
    return np.concatenate([neurons.ravel(), network.bias])


def _bandwidth(device: str) -> float:
    """Bytes per second, read and written, of a plain copy."""
    source = torch.zeros(COPIED, device=device)
    sink = torch.empty_like(source)

    def copy() -> None:
        sink.copy_(source)
        torch.cuda.synchronize()

    return 2 * 4 * COPIED / statistics.median(_seconds(copy, 10))


if __name__ == "__main__":
    sys.exit(main())
