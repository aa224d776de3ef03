"""Compares truepath with other packages on the same data, in the same run, and prints a table with ratios.

    .venv/bin/python workflows/benchmark.py [--rounds 5] [--json]

Kinematic solve: all 800 measured UR5 poses (Jacobi 2025), truepath against the package robotkinecal. Each
runs in a process of its own, the two in turn; the time is that of the solve alone, without imports and
reading, after one untimed run. Accuracy is compared on splits 80/20 that both get as row numbers: with
five rounds every pose is held out once.

Correction: a welding path of 100,000 waypoints corrected at once, with a calibration that carries every named effect,
against Drake's InverseKinematics for a sample of the same waypoints one by one, on a plant context with the same
calibrated frames (Drake's plant is rigid: it is spared the effects).

Program: ``truepath correct`` on 100,000 lines of URScript, with collisions looked for; no peer, but reading and writing
must not be the larger half of it (``program_benchmark.py``).

Evolution: a generation of 200 networks in one go, against one network at a time (``generation_benchmark.py``).

Every process but that one is held to one thread of linear algebra: on small matrices a second one only waits when the
machine is busy. A ratio is peer / truepath: above 1, truepath is better. What is absent, peer or data, is skipped
and named. Accuracy counts as equal within half a micrometre: both fit 27 parameters, two of which this data hardly
determines; a prior holds ours back, so the peer is a hair closer where it was fitted. A miss ends in exit code 1.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

SCHEMA = "truepath.benchmark/1"
ROOT = Path(__file__).resolve().parents[1]
PEER_SCRIPT = ROOT / "workflows" / "peers" / "robotkinecal_solve.py"
URDF = ROOT / "models" / "ur5" / "ur5.urdf"
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL")}
SPEEDUP_REQUIRED, CORRECTION_SPEEDUP, GENERATION_SPEEDUP = 20.0, 100.0, 20.0
LARGEST_SHARE = 0.5
TIE_MM = 0.0005  # a thirtieth of the tracker's own error
FOLDS = 5


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=FOLDS, help=f"1 to {FOLDS}; each takes about 20 s")
    parser.add_argument("--repeat", type=int, default=1, help="timed solves per process and round")
    parser.add_argument("--waypoints", type=int, default=100_000)
    parser.add_argument("--sample", type=int, default=200, help="waypoints that Drake solves")
    parser.add_argument("--lines", type=int, default=100_000, help="of the program")
    parser.add_argument("--generations", type=int, default=30, help="of the evolution, timed")
    parser.add_argument("--peers", type=Path, default=ROOT / ".venv-peers", help="virtual environment of the peers")
    parser.add_argument("--json", action="store_true", help="print JSON for machines instead of a table")
    # For the processes that this script starts, as for the peer's script:
    parser.add_argument("--solve-ours", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--csv", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--train-rows", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    counts = (options.rounds, options.repeat, options.sample, options.waypoints, options.lines)
    if options.rounds > FOLDS or min(counts) < 1:
        parser.error(f"--rounds must be 1 to {FOLDS}, the other numbers at least 1")
    if options.solve_ours:
        print(json.dumps(solve_ours(options.csv, options.train_rows, options.repeat)))
    else:
        report = compare(options)
        print(json.dumps(report, indent=1, allow_nan=False)) if options.json else print_table(report)
        return int(any(row["met"] is False for row in report["rows"]))  # a missed requirement is no success
    return 0


def compare(options: argparse.Namespace) -> dict[str, Any]:
    """Runs everything that can be run here; the report."""
    rows: list[dict] = []
    skipped: list[str] = []
    details: dict[str, Any] = {}
    load = os.getloadavg()[0]
    data = Path(os.environ.get("TRUEPATH_DATA") or ROOT.parent / "shared" / "data")
    csv, peer_python = data / "ur5_jacobi2025" / "grid.csv", options.peers / "bin" / "python"
    if not csv.is_file():
        skipped.append(f"kinematic solve: no {csv}; set TRUEPATH_DATA to the folder of the published data sets")
    else:
        if not peer_python.exists():
            skipped.append(f"robotkinecal: no environment in {options.peers}; `make bench` creates it")
        ours, peer = _solve_rounds(csv, peer_python, options, skipped)
        rows += _solve_rows(ours, peer)
        details["solve"] = {"truepath": ours, "robotkinecal": peer}
    _say("correction")
    script = [sys.executable, str(ROOT / "workflows" / "correction_benchmark.py")]
    script += ["--waypoints", str(options.waypoints), "--sample", str(options.sample)]
    details["correction"] = _run(script)
    rows += _correction_rows(details["correction"])
    _say("a long program")
    script = [sys.executable, str(ROOT / "workflows" / "program_benchmark.py"), "--lines", str(options.lines)]
    details["program"] = _run(script)
    rows += _program_rows(details["program"])
    _say("a generation of the evolution")
    script = [sys.executable, str(ROOT / "workflows" / "generation_benchmark.py"), "--rounds", str(options.generations)]
    details["generation"] = _run(script, all_cores=True)
    rows += _generation_rows(details["generation"])
    machine = {"cpus": os.cpu_count(), "load_at_start": load}
    return {"schema": SCHEMA, "machine": machine, "rows": rows, "skipped": skipped, "details": details}


def _solve_rounds(
    csv: Path, peer_python: Path, options: argparse.Namespace, skipped: list[str]
) -> tuple[list[dict], list[dict]]:
    """Per round, what truepath and the peer say about all poses (time) and about one split (accuracy)."""
    ours_script = [sys.executable, str(Path(__file__).resolve()), "--solve-ours", "--csv", str(csv)]
    peer_script = [str(peer_python), str(PEER_SCRIPT), "--urdf", str(URDF), "--csv", str(csv)]
    ours: list[dict] = []
    peer: list[dict] = []
    with csv.open(encoding="utf-8") as file:
        order = np.random.default_rng(0).permutation(sum(1 for line in file if line.strip()) - 1)
    with tempfile.TemporaryDirectory() as folder:
        rows = Path(folder) / "rows.json"
        for number in range(options.rounds):
            _say(f"kinematic solve, round {number + 1} of {options.rounds}")
            rows.write_text(json.dumps(sorted(int(k) for k in np.delete(order, slice(number, None, FOLDS)))))
            ours.append(_whole_and_split(ours_script, rows, options.repeat))
            if len(peer) == number and peer_python.exists():
                try:
                    peer.append(_whole_and_split(peer_script, rows, options.repeat))
                except RuntimeError as error:
                    skipped.append(f"robotkinecal: {error}")
    return ours, peer if len(peer) == len(ours) else []


def _whole_and_split(script: list[str], train_rows: Path, repeat: int) -> dict[str, dict]:
    whole = _run([*script, "--repeat", str(repeat)])
    return {"whole": whole, "split": _run([*script, "--repeat", "1", "--train-rows", str(train_rows)])}


def _row(what: str, unit: str, ours: float, peer_name: str, peer: float | None, **more: Any) -> dict[str, Any]:
    """One line of the table; ``required`` and ``met`` where there is a requirement."""
    ratio = None if peer is None else peer / ours
    row = {"what": what, "unit": unit, "truepath": ours, "peer": peer, "peer_name": peer_name, "ratio": ratio}
    return {**row, "required": "", "met": None, **more}


def _solve_rows(ours: list[dict], peer: list[dict]) -> list[dict]:
    def typical(results: list[dict], part: str, key: str) -> float | None:
        pick = statistics.median if key == "solve_s" else statistics.mean
        return pick(result[part][key] for result in results) if results else None

    ratio = met = None
    if peer:
        pairs = zip(ours, peer, strict=True)
        ratio = statistics.median(b["whole"]["solve_s"] / a["whole"]["solve_s"] for a, b in pairs)
        met = ratio >= SPEEDUP_REQUIRED
    seconds, theirs = (typical(results, "whole", "solve_s") for results in (ours, peer))
    assert seconds is not None
    what, required = f"kinematic solve, {ours[0]['whole']['poses']} poses", f"ratio >= {SPEEDUP_REQUIRED:g}"
    rows = [_row(what, "s", seconds, "robotkinecal", theirs, ratio=ratio, required=required, met=met)]
    for what, key in (("in the fit (80 %)", "train_mean_mm"), ("held out (20 %)", "heldout_mean_mm")):
        mine, other = (typical(results, "split", key) for results in (ours, peer))
        assert mine is not None
        met, required = None if other is None else mine <= other + TIE_MM, f"<= peer + {TIE_MM:g}"
        rows.append(_row(f"mean error, poses {what}", "mm", mine, "robotkinecal", other, required=required, met=met))
    return rows


def _correction_rows(result: dict[str, Any]) -> list[dict]:
    what, peer = f"correction, {result['waypoints']} waypoints, all effects", "Drake IK"
    ours, theirs, required = result["per_waypoint_us"], result["ik_per_waypoint_us"], f"ratio >= {CORRECTION_SPEEDUP:g}"
    met = theirs / ours >= CORRECTION_SPEEDUP
    return [
        _row(f"{what}, time for each", "us", ours, peer, theirs, required=required, met=met),
        _row(f"{what}, worst error left", "um", result["max_error_um"], peer, result["ik_max_error_um"], ratio=None),
    ]


def _program_rows(result: dict[str, Any]) -> list[dict]:
    what, share = f"program of {result['lines']} lines", result["parse_and_write_share"]
    required, met = f"<= {LARGEST_SHARE:g}", share <= LARGEST_SHARE
    return [
        _row(f"{what}, whole command", "s", result["command_s"], "", None),
        _row(f"{what}, share of reading and writing", "", share, "", None, required=required, met=met),
    ]


def _generation_rows(result: dict[str, Any]) -> list[dict]:
    networks = f"a generation of {result['individuals']} networks"
    of_any_size = f"{networks}, up to {result['largest']} neurons, {result['poses']} poses"
    dearest = result["dearest"]
    of_the_largest = f"{networks}, all trials of {dearest['neurons_of_the_best']} neurons (the dearest)"
    return [
        _generation_row(of_any_size, result, "torch", required=GENERATION_SPEEDUP),
        _generation_row(of_any_size, result, "numpy"),
        _generation_row(of_the_largest, dearest, "torch", required=GENERATION_SPEEDUP),
    ]


def _generation_row(what: str, times: dict[str, Any], peer: str, required: float | None = None) -> dict[str, Any]:
    ours, theirs = 1e3 * times["batched_s"], 1e3 * times[f"{peer}_s"]
    judged = {} if required is None else {"required": f"ratio >= {required:g}", "met": theirs / ours >= required}
    return _row(what, "ms", ours, f"one at a time, {peer}", theirs, **judged)


def solve_ours(csv: Path, train_rows: Path | None, repeat: int) -> dict[str, Any]:
    """What ``robotkinecal_solve.py`` prints, for truepath."""
    from truepath.calibrate import calibrate
    from truepath.plants import load_robot
    from truepath.readers import read_measurements

    robot = load_robot(URDF)
    measurements = read_measurements(csv, robot, "jacobi2025")
    train = np.arange(len(measurements)) if train_rows is None else np.array(json.loads(train_rows.read_text()))
    heldout, known = np.setdiff1d(np.arange(len(measurements)), train), measurements.subset(train)
    calibrate(robot, known)  # warm-up: builds the CasADi function
    seconds = []
    for _ in range(repeat):
        start = time.perf_counter()
        fit = calibrate(robot, known)
        seconds.append(time.perf_counter() - start)
    errors_mm = 1e3 * np.linalg.norm(fit.model.predict(measurements.q_rad)[:, :3, 3] - measurements.p_ME, axis=1)
    report: dict[str, Any] = {
        "poses": len(train),
        "solve_s": statistics.median(seconds),
        "solve_s_all": seconds,
        "iterations": fit.iterations,
        "train_mean_mm": float(errors_mm[train].mean()),
        "parameters": len(fit.names) - len(fit.held),
    }
    if len(heldout):
        report |= {"heldout_poses": len(heldout), "heldout_mean_mm": float(errors_mm[heldout].mean())}
    return report


def _run(command: list[str], *, all_cores: bool = False) -> dict[str, Any]:
    env = {**os.environ} if all_cores else {**os.environ, **ONE_THREAD}
    done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=600)
    try:
        return json.loads(done.stdout.strip().splitlines()[-1])
    except (ValueError, IndexError):
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise RuntimeError(f"{Path(command[1]).name} failed with exit code {done.returncode}: {last}") from None


def print_table(report: dict[str, Any]) -> None:
    """The report for people."""
    from rich.console import Console
    from rich.table import Table

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.5g}"

    table = Table(title="ratio = peer / truepath: above 1, truepath is better", title_justify="left")
    for name in ("", "unit", "truepath", "peer", " ", "ratio", "required", "met"):
        table.add_column(name, justify="right" if name in ("truepath", "peer", "ratio") else "left")
    for row in report["rows"]:
        met = {None: "", True: "yes", False: "no"}[row["met"]]
        cells = (number(row["truepath"]), number(row["peer"]), row["peer_name"], number(row["ratio"]))
        table.add_row(row["what"], row["unit"], *cells, row["required"], met)
    console, machine = Console(highlight=False, width=140), report["machine"]
    console.print(table)
    busy = " (busy when this began: only ratios count)" if machine["load_at_start"] > machine["cpus"] / 2 else ""
    console.print(f"{machine['cpus']} CPUs{busy}, one thread each")
    for message in report["skipped"]:
        console.print(f"skipped: {message}", markup=False)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
