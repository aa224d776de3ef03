"""Does the evolution pay, and which gradient training is best? A table for each question.

    .venv/bin/python workflows/does_evolution_pay.py [--seeds 10] [--json FILE]

First table. Evolution and the training that follows take some time T. Against that, with the same training and the same
total time: 20 random starts, each trained for a twentieth of T, of which the one with the lowest error on the
validation part is taken; and random starts trained to their end, one after the other, until T is over. Sizes of random
networks are drawn from the range that the evolution has. What counts is the error on poses that no training saw.

Second table. From the same random starts, for the same time as Levenberg-Marquardt needs to its end: L-BFGS and Adam
on the same error, stopped by the same validation part (they learn no weight decay, which is part of what our
Levenberg-Marquardt does). Everything runs on one thread.

Tasks: what the kinematic calibration of the real UR5 leaves (skipped where the data is not there) and of a simulated
robot (``reproduce_paper.py`` says how it is made), and the paper's direct network.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).resolve().parent))

from reproduction.cases import experiment, grid_csv
from reproduction.simulated import Design, simulate
from truepath.calibrate import calibrate
from truepath.files import write_atomically
from truepath.residual.direct import LONG, PAPER
from truepath.residual.evolution import evolve
from truepath.residual.learning import Lesson, Scaling
from truepath.residual.limits import Limits, Settings
from truepath.residual.network import Network, forward, one_thread, with_ones
from truepath.residual.samples import Samples
from truepath.residual.training import train

SCHEMA = "truepath.evolution_study/1"
RANDOM_STARTS = 20
NARROW_DEG = 20.0
NOISE_MM = 0.03
ADAM_RATE, LBFGS_MEMORY = 3e-3, 20


@dataclass(frozen=True, eq=False)
class Task:
    """Something to learn, and poses to be asked about afterwards.

    Attributes:
        lesson: for one network.
        settings, limits: of evolution and training.
        x, target: ``(K, d)`` and ``(K, k)`` of the poses to be asked about, scaled like the lesson.
        unit_mm: size of a scaled position.
    """

    lesson: Lesson
    settings: Settings
    limits: Limits
    x: np.ndarray
    target: np.ndarray
    unit_mm: float

    def test_mm(self, network: Network) -> float:
        """Mean error of the position on poses that no training saw."""
        return self.unit_mm * float(np.linalg.norm(network(self.x) - self.target, axis=1).mean())

    def validation_error(self, network: Network) -> float:
        rows = self.lesson.validation
        return float(np.sqrt(np.mean((network(self.lesson.x[rows]) - self.lesson.target[rows]) ** 2)))

    def random_start(self, rng: np.random.Generator) -> Network:
        neurons = int(rng.integers(self.settings.smallest, self.settings.largest + 1))
        inputs, outputs = self.lesson.x.shape[1], self.lesson.target.shape[1]
        hidden, output = rng.uniform(-1, 1, (neurons, inputs + 1)), rng.uniform(-1, 1, (outputs, neurons))
        return Network(hidden, output, rng.uniform(-1, 1, (outputs,)))

    def trained(self, start: Network, limits: Limits | None = None) -> Network:
        lesson = self.lesson
        return train(start, lesson.x, lesson.target, lesson.validation, limits=limits or self.limits).network


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--json", type=Path, help="also write everything to this file")
    options = parser.parse_args(arguments)
    tasks: dict[str, Callable[[int], Task]] = {
        "residual of the simulated robot": simulated_residual,
        f"direct, simulated robot, +-{NARROW_DEG:g} deg": simulated_direct,
    }
    if grid_csv().is_file():
        tasks = {"residual of the real UR5": measured_residual, **tasks}
    else:
        print(f"skipped: the real UR5, there is no {grid_csv()}; set TRUEPATH_DATA", file=sys.stderr)
    with one_thread():
        results = [
            {"task": name, "seed": seed, **result}
            for name, make in tasks.items()
            for seed in range(options.seeds)
            for result in _say(f"{name}, seed {seed}", compare(make(seed), seed))
        ]
    print_tables(results)
    if options.json:
        write_atomically(options.json, json.dumps({"schema": SCHEMA, "results": results}, indent=1) + "\n")
    return 0


def measured_residual(seed: int) -> Task:
    robot, known, fresh = experiment(seed)
    return _residual(calibrate(robot, known).model, known, fresh, seed)


def simulated_residual(seed: int) -> Task:
    drawn = simulate(seed, Design(noise_mm=NOISE_MM))
    return _residual(calibrate(drawn.robot, drawn.known).model, drawn.known, drawn.fresh, seed)


def _residual(model: Any, known: Any, fresh: Any, seed: int) -> Task:
    samples, asked = Samples.of(model, known), Samples.of(model, fresh)
    scaling = Scaling.of(samples)
    lesson = scaling.lesson(samples, np.random.default_rng(seed).permutation(len(samples))[: len(samples) // 6], seed)
    x, target = scaling.reach.scaled(asked.q_rad), asked.miss / scaling.scale
    return Task(lesson, Settings(), Limits(), x, target, 1e3 * float(scaling.scale[0]))


def simulated_direct(seed: int) -> Task:
    drawn = simulate(seed, Design(half_range_deg=NARROW_DEG))
    known, fresh = drawn.known, drawn.fresh
    lower, upper = known.q_rad.min(axis=0), known.q_rad.max(axis=0)
    centre, unit = known.p_ME.mean(axis=0), float(known.p_ME.std())
    validation = np.random.default_rng(seed).random(len(known)) < 0.1

    def scaled(measurements: Any) -> tuple[np.ndarray, np.ndarray]:
        return 2 * (measurements.q_rad - lower) / (upper - lower) - 1, (measurements.p_ME - centre) / unit

    lesson = Lesson(*scaled(known), validation, seed)
    return Task(lesson, PAPER, replace(LONG, iterations=300), *scaled(fresh), 1e3 * unit)


def compare(task: Task, seed: int) -> Iterator[dict[str, Any]]:
    """Each way of learning, with its error on fresh poses and the time it took."""
    rng, lesson = np.random.default_rng([seed, 1]), task.lesson
    begun = time.perf_counter()
    seen = ~lesson.validation
    evolved = evolve(lesson.x[seen], lesson.target[seen], task.settings, seed).network
    evolution_s = time.perf_counter() - begun
    network = task.trained(evolved)
    whole_s = time.perf_counter() - begun
    yield {"table": 1, "way": "evolution, then training", "seconds": whole_s, "test_mm": task.test_mm(network)}
    yield {"table": 1, "way": "(evolution alone)", "seconds": evolution_s, "test_mm": task.test_mm(evolved)}

    starts = [task.random_start(rng) for _ in range(RANDOM_STARTS)]
    yield {
        "table": 1,
        "way": f"{RANDOM_STARTS} random starts, a share of the time each",
        **_shares(task, starts, whole_s),
    }
    yield {
        "table": 1,
        "way": "random starts to their end, as many as the time allows",
        **_in_turn(task, starts, whole_s),
    }

    start = starts[0]
    begun = time.perf_counter()
    network = task.trained(start)
    seconds = time.perf_counter() - begun
    yield {"table": 2, "way": "Levenberg-Marquardt", "seconds": seconds, "test_mm": task.test_mm(network)}
    for way, method in (("L-BFGS", _lbfgs), ("Adam", _adam)):
        begun = time.perf_counter()
        network = method(task, start, seconds)
        yield {"table": 2, "way": way, "seconds": time.perf_counter() - begun, "test_mm": task.test_mm(network)}


def _shares(task: Task, starts: list[Network], whole_s: float) -> dict[str, Any]:
    """All starts trained for the same part of the time, counted in iterations."""
    begun = time.perf_counter()
    networks: list[Network] = []
    for start in starts:
        probe = time.perf_counter()
        first = task.trained(start, Limits(iterations=3))
        per_iteration = (time.perf_counter() - probe) / 3
        more = int(whole_s / len(starts) / per_iteration)
        networks.append(task.trained(start, replace(task.limits, iterations=more)) if more > 3 else first)
    best = min(networks, key=task.validation_error)
    return {"seconds": time.perf_counter() - begun, "test_mm": task.test_mm(best)}


def _in_turn(task: Task, starts: list[Network], whole_s: float) -> dict[str, Any]:
    begun = time.perf_counter()
    networks: list[Network] = []
    for start in starts:
        if networks and (time.perf_counter() - begun) * (1 + 1 / len(networks)) > whole_s:
            break
        networks.append(task.trained(start))
    best = min(networks, key=task.validation_error)
    return {"seconds": time.perf_counter() - begun, "starts": len(networks), "test_mm": task.test_mm(best)}


def _lbfgs(task: Task, start: Network, seconds: float) -> Network:
    return _descend(task, start, seconds, lambda p: torch.optim.LBFGS(p, history_size=LBFGS_MEMORY, max_iter=5))


def _adam(task: Task, start: Network, seconds: float) -> Network:
    return _descend(task, start, seconds, lambda p: torch.optim.Adam(p, lr=ADAM_RATE))


def _descend(
    task: Task, start: Network, seconds: float, optimiser: Callable[[list[torch.Tensor]], torch.optim.Optimizer]
) -> Network:
    """Any of torch's optimisers, until the time is over; the weights with the lowest validation error."""
    lesson, end = task.lesson, time.perf_counter() + seconds
    parts = [torch.tensor(part[None], requires_grad=True) for part in (start.hidden, start.output, start.bias)]
    x1 = with_ones(torch.tensor(lesson.x[~lesson.validation]))
    target = torch.tensor(lesson.target[~lesson.validation].T.copy())
    steps = optimiser(parts)

    def error() -> torch.Tensor:
        steps.zero_grad()
        value = (forward(parts[0], parts[1], parts[2], x1)[0] - target).square().mean()
        value.backward()
        return value

    best, lowest = start, task.validation_error(start)
    while time.perf_counter() < end:
        steps.step(error)  # type: ignore[arg-type]
        network = Network(*(part.detach().numpy()[0].copy() for part in parts))
        if (now := task.validation_error(network)) < lowest:
            best, lowest = network, now
    return best


def print_tables(results: list[dict[str, Any]]) -> None:
    """Medians over the seeds, and how often a way was better than the first one of its table."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, width=140)
    for number, title in ((1, "does the evolution pay?"), (2, "which gradient training?")):
        table = Table(title=f"{title} Median over the seeds (range)", title_justify="left")
        for name in ("task", "way", "test error, mm", "better than the first", "seconds"):
            table.add_column(name)
        for task in dict.fromkeys(result["task"] for result in results):
            rows = [result for result in results if result["table"] == number and result["task"] == task]
            ways = list(dict.fromkeys(row["way"] for row in rows))
            first = {row["seed"]: row["test_mm"] for row in rows if row["way"] == ways[0]}
            for way in ways:
                mine = [row for row in rows if row["way"] == way]
                errors = [row["test_mm"] for row in mine]
                better = sum(row["test_mm"] < first[row["seed"]] for row in mine)
                table.add_row(
                    task if way == ways[0] else "",
                    way,
                    f"{statistics.median(errors):.4f} ({min(errors):.4f} to {max(errors):.4f})",
                    "" if way == ways[0] else f"{better} of {len(mine)}",
                    f"{statistics.median(row['seconds'] for row in mine):.2f}",
                )
        console.print(table)


def _say(text: str, results: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    for result in results:
        print(f"{text}: {result['way']}", file=sys.stderr, flush=True)
        yield result


if __name__ == "__main__":
    sys.exit(main())
