"""Does the diagnosis name the right cause? Robots with hidden causes are measured, diagnosed, then unsealed.

Prints the table of what was asked for and what was found; exits with 1 if something asked for is missed.

    python workflows/hidden_effects.py --seeds 100 --jobs 2 --json out/hidden_effects.json
    python workflows/hidden_effects.py --seeds 20 --rows none pair
    python workflows/hidden_effects.py --case single:backlash 7
"""

from __future__ import annotations

import argparse
import importlib
import json
import multiprocessing
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

TESTS = Path(__file__).parents[1] / "tests"
GAIN_EFFECTS = ("transmission_error", "joint_compliance", "encoder_scale", "axis_wobble")
DESIGNS = ("small_workspace", "sweep", "scale")
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}

Case = tuple[str, int]


@dataclass
class Outcome:
    """What became of a case.

    Attributes:
        kind, seed, truth: what was hidden.
        passed: the verdict is what the case asks for; ``named_anything`` what the findings name.
        verdict, verdict_after: findings, ambiguities and the rest, the second after further measurements.
        covered: of each physical parameter its name, truth, value, sigma and whether the interval holds the truth.
        gain: true gain, stated interval, and whether the interval holds it; None where there is no such gain.
        trouble: traceback of a failure.
    """

    kind: str
    seed: int
    truth: dict[str, Any] = field(default_factory=dict)
    passed: bool = False
    named_anything: bool = False
    verdict: dict[str, Any] = field(default_factory=dict)
    verdict_after: dict[str, Any] | None = None
    covered: list[dict[str, Any]] = field(default_factory=list)
    gain: dict[str, Any] | None = None
    seconds: float = 0.0
    trouble: str | None = None


@dataclass(frozen=True)
class Row:
    """A row of the table: the share of its cases (or intervals) for which ``count`` says yes, and its limits."""

    title: str
    cases: Callable[[int], list[Case]]
    count: Callable[[Outcome], list[bool]]
    least: float = 0.0
    most: float = 1.0

    @property
    def requirement(self) -> str:
        if self.most == 1.0:
            return f">= {self.least:.0%}"
        return f"<= {self.most:.0%}" if self.least == 0.0 else f"{100 * self.least:.0f} to {self.most:.0%}"


def main(arguments: list[str] | None = None) -> int:
    """Prints the table; 0 if all is as it should be, else 1."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100, help="cases of each row (default 100)")
    parser.add_argument("--first-seed", type=int, default=0, help="where they start: others than truepath was tuned on")
    parser.add_argument(
        "--rows", nargs="+", choices=list(table_rows()), default=list(table_rows()), help="which rows (default all)"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes, of one thread each (default 2)")
    parser.add_argument("--json", type=Path, help="write every failed case to this file")
    parser.add_argument("--case", nargs=2, metavar=("KIND", "SEED"), help="one case only, told in full")
    given = parser.parse_args(arguments)
    if given.seeds < 1 or given.jobs < 1:
        parser.error("seeds and jobs must be larger than 0")
    if given.case:
        outcome = run_case((given.case[0], int(given.case[1])))
        print(json.dumps(asdict(outcome), indent=1, default=str))
        return 0 if outcome.passed else 1
    rows = table_rows(given.first_seed)
    wanted = {name: rows[name] for name in given.rows}
    cases = list(dict.fromkeys(case for row in wanted.values() for case in row.cases(given.seeds)))
    outcomes = run_cases(cases, given.jobs)
    text, complaints = report(wanted, outcomes, given.seeds)
    print(text)
    if given.json:
        failed = [asdict(outcome) for outcome in outcomes.values() if is_suspicious(outcome)]
        given.json.parent.mkdir(parents=True, exist_ok=True)
        given.json.write_text(json.dumps(failed, indent=1, default=str) + "\n")
    for complaint in complaints:
        print(f"missed: {complaint}")
    return 1 if complaints else 0


def table_rows(first: int = 0) -> dict[str, Row]:
    """The rows by name. Cases that two rows share are run once."""
    effects = hidden("").EFFECTS
    physical = hidden("verdict").PHYSICAL

    def singles(names: Iterable[str]) -> Callable[[int], list[Case]]:
        kinds = [f"single:{name}" for name in names]
        return lambda seeds: spread(kinds, seeds, first)

    def passed(outcome: Outcome) -> list[bool]:
        return [outcome.passed]

    return {
        "single": Row("one identifiable effect: effect and joints named", singles(effects), passed, least=0.95),
        "pair": Row("two effects at once, both named", lambda n: spread(["pair"], n, first), passed, least=0.90),
        "none": Row(
            "no effect: something named", lambda n: spread(["none"], n, first), lambda o: [o.named_anything], most=0.03
        ),
        "outside": Row(
            "a cause outside the library: unexplained, no wrong cause named",
            lambda n: spread(["outside"], n, first),
            passed,
            least=0.90,
        ),
        "confounded": Row(
            "confounded design: reported ambiguous; after adding `measure_next`, resolved",
            lambda n: spread([f"confounded:{design}" for design in DESIGNS], n, first),
            passed,
            least=0.90,
        ),
        "parameters": Row(
            "95 % intervals of effect parameters cover the truth",
            singles(physical),
            lambda o: [row["covers"] for row in o.covered],
            least=0.90,
            most=0.99,
        ),
        "gain": Row(
            "stated gain interval covers the gain on 5000 fresh poses",
            singles(GAIN_EFFECTS),
            lambda o: [] if o.gain is None else [o.gain["covers"]],
            least=0.90,
            most=0.99,
        ),
    }


def spread(kinds: list[str], count: int, first: int) -> list[Case]:
    """``count`` cases, the kinds in turn, from a first seed on."""
    return [(kinds[k % len(kinds)], first + k // len(kinds)) for k in range(count)]


def run_cases(cases: list[Case], jobs: int) -> dict[Case, Outcome]:
    """Every case judged, in processes of one thread each."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    os.environ.update(ONE_THREAD)  # a spawned process reads them before it loads numpy
    outcomes = {}
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    context = multiprocessing.get_context("spawn")
    with (
        Progress(*columns, console=Console(stderr=True)) as progress,
        ProcessPoolExecutor(jobs, mp_context=context) as executor,
    ):
        task = progress.add_task("diagnosing", total=len(cases))
        for done in as_completed([executor.submit(run_case, case) for case in cases]):
            outcome = done.result()
            outcomes[outcome.kind, outcome.seed] = outcome
            if not outcome.passed:
                told = outcome.trouble.splitlines()[-1] if outcome.trouble else outcome.truth.get("effects")
                progress.console.print(f"not as hidden: {outcome.kind} {outcome.seed} {told}", highlight=False)
            progress.advance(task)
    return outcomes


def run_case(case: Case) -> Outcome:
    """Draws a case, has it diagnosed, opens the truth and judges. A crash is a case that was not passed."""
    kind, seed = case
    outcome = Outcome(kind, seed)
    start = time.perf_counter()
    try:
        drawn = hidden("").draw_case(kind, seed)
        try:
            judge(outcome, drawn)
        finally:
            truth = drawn.unseal()
            parameters = [[*key, value] for key, value in truth.parameters.items()]
            outcome.truth = {**asdict(truth), "parameters": parameters}
    except Exception:
        outcome.trouble = traceback.format_exc()
    outcome.seconds = time.perf_counter() - start
    return outcome


def judge(outcome: Outcome, case: Any) -> None:
    """Fills in what became of a case."""
    said = hidden("verdict")
    diagnosis, verdict = said.diagnose_csv(case.spec, case.csv, plan=True)
    outcome.verdict = verdict
    truth = case.unseal()
    found = said.named(verdict, truth)
    outcome.named_anything = bool(found)
    group = outcome.kind.partition(":")[0]
    if group == "confounded":
        outcome.passed = said.says_ambiguous(verdict, truth) and settle(outcome, case, diagnosis, truth)
    elif group == "outside":
        outcome.passed = said.says_unexplained(verdict, truth)
    elif outcome.kind == "single:outlier":
        outcome.passed = said.finds_the_outliers(verdict, truth) and not found
    else:
        outcome.passed = said.names_the_truth(verdict, truth)
    if group != "single":
        return
    for (effect, name, joint), value, estimate, sigma in said.intervals(verdict, truth):
        covers = bool(said.covers(effect, value, estimate, sigma))
        row = {"effect": effect, "parameter": name, "joint": joint, "truth": value}
        outcome.covered.append({**row, "value": estimate, "sigma": sigma, "covers": covers})
    causes = [finding for finding in verdict["findings"] if finding["effect"] in found]
    if truth.pose_only and len(causes) == 1:
        gain = said.true_gain_mm(diagnosis, case)
        low, high = causes[0]["heldout_gain_mm"]["ci95"]
        outcome.gain = {"true_mm": gain, "ci95": [low, high], "covers": low <= gain <= high}


def settle(outcome: Outcome, case: Any, diagnosis: Any, truth: Any) -> bool:
    """Whether the poses that were asked for settle it. No pose of the robot can settle what the tracker's scale is."""
    said = hidden("verdict")
    if outcome.kind == "confounded:scale":
        return True
    further = said.poses_to_measure(diagnosis, truth)
    if further is None:
        return False
    _, outcome.verdict_after = said.diagnose_csv(case.spec, case.measure_more(further))
    return bool(said.is_resolved(outcome.verdict_after, truth))


def report(rows: dict[str, Row], outcomes: dict[Case, Outcome], seeds: int) -> tuple[str, list[str]]:
    """The table in markdown, and the rows that miss what is required of them."""
    lines = ["| study | required | found | |", "|---|---|---|---|"]
    complaints = []
    for row in rows.values():
        own = [outcomes[case] for case in row.cases(seeds)]
        yes = [answer for outcome in own for answer in row.count(outcome)]
        share = sum(yes) / len(yes) if yes else float("nan")
        crashed = sum(outcome.trouble is not None for outcome in own)
        kept = bool(yes) and row.least <= share <= row.most and not crashed
        counts = f"{sum(yes)} of {len(yes)}" + (f", {crashed} crashed" if crashed else "")
        lines.append(f"| {row.title} | {row.requirement} | {share:.1%} | {counts} |")
        if not kept:
            complaints.append(f"{row.title}: {row.requirement}, found {share:.1%} ({counts})")
    kinds: dict[str, list[bool]] = {}
    for outcome in outcomes.values():
        kinds.setdefault(outcome.kind, []).append(outcome.passed)
    lines += ["", "| kind of case | passed |", "|---|---|"]
    lines += [f"| {kind} | {sum(passed)} of {len(passed)} |" for kind, passed in sorted(kinds.items())]
    return "\n".join(lines), complaints


def is_suspicious(outcome: Outcome) -> bool:
    """Whether somebody should look at this case."""
    missed = [row for row in outcome.covered if not row["covers"]]
    return not outcome.passed or bool(missed) or (outcome.gain is not None and not outcome.gain["covers"])


def hidden(module: str) -> Any:
    """The generator, or one of its modules, from the tests: this script has the name of the package."""
    if str(TESTS) not in sys.path[:1]:
        sys.path.insert(0, str(TESTS))
    return importlib.import_module(f"hidden_effects.{module}" if module else "hidden_effects")


if __name__ == "__main__":
    sys.exit(main())
