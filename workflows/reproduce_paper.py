"""The paper's two protocols: its four tables beside truepath's, and the errors pose by pose.

The paper is Jiang, Yu, Jia, Zhao, Xia 2020, "Absolute Positioning Accuracy Improvement in an Industrial Robot". Its
simulation is repeated with robots that Drake moves, its experiment with the published measurements of another UR5.
A required figure that is missed is printed as missed; the exit code is 1 only if something broke.

    python workflows/reproduce_paper.py --markdown out/paper.md --json out/paper.json --figures out/figures
    python workflows/reproduce_paper.py --seeds 2 --splits 2 --ranges
    python workflows/reproduce_paper.py --only experiment --rows before kinematic all
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from reproduction.cases import Case, Outcome

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
RANGES_DEG = (10.0, 20.0, 30.0, 45.0, 60.0)
RANGE_SEEDS = 5


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs, prints and writes; 0 unless something broke."""
    os.environ.update(ONE_THREAD)  # before numpy is loaded, here and in the processes
    given = parse(arguments)
    from reproduction.figures import draw_figures
    from reproduction.summary import summarise
    from reproduction.text import markdown, print_report

    cases, skipped = plan(given)
    outcomes = run_cases(cases, given.jobs)
    settings = {
        "seeds": given.seeds if given.only != "experiment" else 0,
        "splits": given.splits if any(case.protocol == "experiment" for case in cases) else 0,
        "half_range_deg": given.range_deg,
        "order": given.order,
    }
    report = summarise(outcomes, settings, skipped)
    print_report(report)
    for path, text in (
        (given.json, json.dumps(report, indent=1, allow_nan=False) + "\n"),
        (given.markdown, markdown(report)),
    ):
        if path:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    if given.figures:
        for path in draw_figures(outcomes, given.figures):
            print(f"wrote {path}")
    for failure in report["failed"]:
        print(failure["trouble"], file=sys.stderr)
    return 1 if report["failed"] else 0


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The options, checked."""
    from reproduction.published import ROWS
    from reproduction.simulated import HALF_RANGE_DEG, ORDER

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--only", choices=("simulation", "experiment"), help="one protocol (default both)")
    add("--seeds", type=int, default=20, help="simulated robots (default 20)")
    add("--splits", type=int, default=10, help="splits of the real robot's poses (default 10)")
    add("--noise-mm", type=float, nargs="+", default=[0.0, 0.03], help="of the poses to fit, per axis (default 0 0.03)")
    add("--range-deg", type=float, default=HALF_RANGE_DEG, help=f"joints move by plus and minus ({HALF_RANGE_DEG:g})")
    add("--order", type=int, default=ORDER, help=f"of the Chebyshev polynomials (default {ORDER})")
    add("--ranges", type=float, nargs="*", default=list(RANGES_DEG), help="of the table by joint range; none: no table")
    add("--range-seeds", type=int, default=RANGE_SEEDS, help=f"robots of that table, at most (default {RANGE_SEEDS})")
    add("--rows", nargs="+", choices=list(ROWS), default=list(ROWS), help="which ways of predicting (default all)")
    add("--jobs", type=int, default=2, help="processes, of one thread each (default 2)")
    add("--json", type=Path, help="write everything to this file")
    add("--markdown", type=Path, help="write the tables to this file")
    add("--figures", type=Path, metavar="FOLDER", help="draw the errors of the first robot and the first split")
    given = parser.parse_args(arguments)
    if min(given.seeds, given.splits, given.range_seeds, given.jobs) < 1:
        parser.error("--seeds, --splits, --range-seeds and --jobs must be larger than 0")
    if min(given.noise_mm) < 0 or given.order < 0:
        parser.error("--noise-mm and --order cannot be negative")
    if not all(0 < half_range <= 180 for half_range in (given.range_deg, *given.ranges)):
        parser.error("--range-deg and --ranges must be larger than 0 and at most 180")
    return given


def plan(given: argparse.Namespace) -> tuple[list[Case], list[str]]:
    """The cases, the long ones first, and what is skipped for want of data."""
    from reproduction.cases import Case, grid_csv
    from reproduction.simulated import Design

    rows, cases, skipped = tuple(given.rows), [], []
    if given.only != "experiment":
        for noise_mm in dict.fromkeys(given.noise_mm):
            design = Design(given.range_deg, given.order, noise_mm)
            cases += [Case("simulation", seed, rows, design) for seed in range(given.seeds)]
        if "direct" in rows:
            for half_range in sorted(set(given.ranges), reverse=True):
                design = Design(half_range, given.order)
                cases += [Case("ranges", k, ("direct",), design) for k in range(min(given.seeds, given.range_seeds))]
    if given.only != "simulation":
        if grid_csv().is_file():
            cases += [Case("experiment", number, rows) for number in range(given.splits)]
        else:
            where = "set TRUEPATH_DATA to the folder of the published data sets"
            skipped.append(f"experiment: no {grid_csv()}; {where}")
    return cases, skipped


def run_cases(cases: Sequence[Case], jobs: int) -> list[Outcome]:
    """Every case, in processes of one thread each, in the order given; a single job runs in this process."""
    from reproduction.cases import run_case

    outcomes: dict[Case, Outcome] = {}
    with progress(len(cases)) as done:
        for outcome in _each(run_case, cases, jobs):
            outcomes[outcome.case] = outcome
            done(outcome)
    return [outcomes[case] for case in cases]


def _each(run: Callable[[Case], Outcome], cases: Sequence[Case], jobs: int) -> Iterable[Outcome]:
    if jobs == 1:
        yield from map(run, cases)
        return
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as executor:
        for future in as_completed([executor.submit(run, case) for case in cases]):
            yield future.result()


@contextmanager
def progress(total: int) -> Iterator[Callable[[Outcome], None]]:
    """A bar; the yielded function is told about every case that is done."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    times = (TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, *times, console=Console(stderr=True)) as shown:
        task = shown.add_task("reproducing", total=total)

        def done(outcome: Outcome) -> None:
            if outcome.trouble is not None:
                told = outcome.trouble.strip().splitlines()[-1]
                shown.console.print(f"failed: {outcome.case.protocol} {outcome.case.seed}: {told}", markup=False)
            shown.advance(task)

        yield done


if __name__ == "__main__":
    sys.exit(main())
