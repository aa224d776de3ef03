"""Is anything lost or invented when ``truepath record`` is killed or disturbed? Many runs, each at a random moment.

    .venv/bin/python workflows/record_faults.py [--runs 200] [--seed 0] [--workers 2] [--json FILE]

Each run records a few poses of a virtual robot with play in its gears. At a random moment something happens: the
recorder or one of its children is killed, the last row on the disk is torn, the robot stops, is cut off or restarts,
packets are late or missing, the beam breaks. Then the recorder is started again with ``--resume`` until the list is
complete. Held against each other: the rows on the disk after the first interruption and at the end; the poses of the
list; and where Drake says that the robot with its hidden errors puts the reflector at the joints and from the side
that the row states. Exit code 1 if a row was lost, repeated or invented, or if a run hung or ended by a fault of
truepath.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from recording_faults.disturbances import DISTURBANCES, disturb
from recording_faults.recorder import Recorder
from recording_faults.rows import Truth, complete_rows, what_is_wrong
from truepath.files import write_atomically
from truepath.planning.pose_list import PoseList, to_csv
from truepath.virtual.controller.process import ControllerProcess

SCHEMA = "truepath.record_faults/1"
SPEED_UP = 20.0
HOME_RAD = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
REACH_RAD = 0.5
HIDDEN = ("backlash",)
MOST_STARTS = 8
FROM_START_TO_FIRST_ROW_S, FROM_ROW_TO_ROW_S = 3.0, 0.7  # about so long, undisturbed


def short_list(rng: np.random.Generator, poses: int) -> PoseList:
    """Poses near the home of the cell, one of them twice, with a place to pass in between."""
    q = HOME_RAD + rng.uniform(-REACH_RAD, REACH_RAD, (poses, 6))
    q = np.concatenate([q[:2], HOME_RAD + rng.uniform(-REACH_RAD, REACH_RAD, (1, 6)), q[2:], q[:1]])
    measure = np.ones(len(q), bool)
    measure[2] = False
    pose_id = np.concatenate([[0, 1, -1], np.arange(2, poses), [0]])
    return PoseList(q, measure, pose_id)


def one_run(
    controller: ControllerProcess, truth: Truth, folder: Path, seed: int, poses: int, kind: str | None = None
) -> dict[str, Any]:
    """A recording that is disturbed once and resumed to its end; what was done, and what is wrong (nothing).

    Args:
        controller: of a robot that ``truth`` knows.
        truth: to be held against.
        folder: new, for the files.
        seed: of the list and of the disturbance.
        poses: different ones.
        kind: of disturbance; by default a random one.
    """
    rng = np.random.default_rng(seed)
    listed = short_list(np.random.default_rng([seed, 1]), poses)
    folder.mkdir()
    (folder / "poses.csv").write_text(to_csv(listed))
    recorder = Recorder(folder, controller.address)
    kind = kind or str(rng.choice(DISTURBANCES))
    after_rows = int(rng.integers(0, listed.measure.sum()))
    after_s = float(rng.uniform(0.0, FROM_ROW_TO_ROW_S if after_rows else FROM_START_TO_FIRST_ROW_S))
    started_s = time.monotonic()
    recorder.start()
    recorder.wait_for_rows(after_rows)
    disturb(kind, after_s, float(rng.uniform(0.3, 4.0)), recorder, controller)
    codes, kept = [recorder.wait()], [complete_rows(folder / "data.csv")]
    while codes[-1] not in (0, 2, 3, None) and len(codes) < MOST_STARTS:
        controller.command({"do": "recover"})
        recorder.start("--resume")
        codes.append(recorder.wait())
        kept.append(complete_rows(folder / "data.csv"))
    wrong = what_is_wrong(folder / "data.csv", kept, listed, truth)
    if codes[-1] != 0:
        wrong.append(f"ended with {codes[-1]}: {recorder.last_words()}")
    return {
        "seed": seed,
        "kind": kind,
        "after_rows": after_rows,
        "after_s": round(after_s, 3),
        "rows_at_interruptions": [max(len(lines) - 1, 0) for lines in kept[:-1]],
        "exit_codes": codes,
        "seconds": round(time.monotonic() - started_s, 1),
        "wrong": wrong,
    }


def some_runs(address: str, seeds: list[int], folder: Path, poses: int) -> list[dict[str, Any]]:
    """Runs on one controller, one after the other."""
    truth = Truth(seed=seeds[0], hidden=HIDDEN)
    results = []
    with ControllerProcess(address, seed=seeds[0], hide=HIDDEN, speed_up=SPEED_UP, tracker_rate_hz=100.0) as controller:
        for seed in seeds:
            controller.command({"do": "recover"})
            results.append(one_run(controller, truth, folder / f"run{seed}", seed, poses))
            print(json.dumps(results[-1]), flush=True, file=sys.stderr)
    return results


def summary(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts of all runs, and the runs in which something was wrong."""
    return {
        "schema": SCHEMA,
        "runs": len(results),
        "interrupted": sum(len(result["exit_codes"]) > 1 for result in results),
        "kinds": dict(Counter(result["kind"] for result in results)),
        "rows_kept_over_an_interruption": sum(sum(result["rows_at_interruptions"]) for result in results),
        "wrong": [result for result in results if result["wrong"]],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--poses", type=int, default=4)
    parser.add_argument("--network", default="127.0.2", help="first three numbers of the loopback addresses used")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    # Else the recorders of a study in the background inherit that nobody can interrupt them.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    seeds = [arguments.seed * 100_000 + k for k in range(arguments.runs)]
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(arguments.workers) as pool:
        parts = [
            pool.submit(
                some_runs, f"{arguments.network}.{10 + k}", seeds[k :: arguments.workers], Path(folder), arguments.poses
            )
            for k in range(min(arguments.workers, arguments.runs))
        ]
        results = [result for part in parts for result in part.result()]
    found = summary(results)
    if arguments.json:
        write_atomically(arguments.json, json.dumps(found, indent=1) + "\n")
    print(json.dumps(found, indent=1))
    bad = len(found["wrong"])
    print(
        f"{found['runs']} runs, {found['interrupted']} interrupted: "
        + ("every completed pose kept once, none lost, none invented" if not bad else f"{bad} WRONG")
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
