"""One generation of the evolution, all networks in one go, against one network at a time: a part of benchmark.py.

    .venv/bin/python workflows/generation_benchmark.py [--individuals 200] [--largest 40] [--poses 1000]
        [--device cuda] [--rounds 30]

All evolve from the same individuals, of sizes drawn up to the largest, on the same samples, in single precision, in
the same process. Trials take the size of the best, so what a generation costs depends on that: it is measured for a
few sizes from 1 to the largest. The times given first are means over these, what a generation costs when the best may
have any size; ``dearest`` are those for the largest, ``by_size`` all of them. A generation is mutation, crossover,
evaluation, selection. Each is timed with one thread and with all cores, a few rounds in turn, the first of which is
not timed; medians over all turns are compared, and of each the quicker number of threads counts. Prints JSON.

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
SIZES = 5  # of the best
TURNS = 5  # so that nobody has the quiet minutes of a shared machine to himself


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--individuals", type=int, default=200)
    parser.add_argument("--largest", type=int, default=40, help="hidden neurons")
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=30, help="generations timed")
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args(arguments)
    sizes = np.unique(np.linspace(1, options.largest, SIZES).round().astype(int)).tolist()
    by_size = [measure(options, neurons) for neurons in sizes]
    means = {name: statistics.mean(each[name] for each in by_size) for name in by_size[0] if name.endswith("_s")}
    stated = {"individuals": options.individuals, "largest": options.largest, "poses": options.poses}
    device = options.device if options.device == "cpu" else torch.cuda.get_device_name()
    print(
        json.dumps({**stated, "device": device, **means, "dearest": by_size[-1], "by_size": by_size}, allow_nan=False)
    )
    return 0


def measure(options: argparse.Namespace, neurons: int) -> dict[str, Any]:
    """Seconds per generation, ours and the peers', the best having so many neurons."""
    from truepath.residual.evolution import Settings, State, first_generation, next_generation
    from truepath.residual.network import one_thread
    from truepath.residual.task import Task

    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (options.poses, INPUTS))
    target = np.column_stack([np.sin(2 * x[:, 0]), x[:, 1] * x[:, 2], np.cos(x[:, 3] + x[:, 4])])
    # No steps of the hidden sizes: the peers have none.
    settings = Settings(options.individuals, 1, options.largest, sizes_every=1 << 30)
    task = Task.of(x, target, options.device)
    first = _with_a_best_of(neurons, first_generation(task, settings, seed=0))

    class Ours:
        state: State = first

        threads = 1

        def generation(self) -> None:
            with one_thread():  # for torch, as a run has it; the threads are those of the evaluation
                self.state = next_generation(self.state, task, settings, seed=0, threads=self.threads)
            if options.device != "cpu":
                torch.cuda.synchronize()

    result: dict[str, Any] = {"neurons_of_the_best": int(first.population.sizes[first.best])}
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


def _with_a_best_of(neurons: int, state: Any) -> Any:
    """The same generation, but for the size of the best."""
    sizes = state.population.sizes.clone()
    sizes[state.best] = neurons
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
