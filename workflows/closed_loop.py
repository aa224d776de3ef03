"""The whole of truepath on a controller: plan, record, diagnose, correct, preview, deploy, measure again.

    .venv/bin/python workflows/closed_loop.py [-o truepath-loop] [--seed 7] [--hide joint_compliance] [--speed-up 20]

A virtual controller plays the robot: it speaks the protocols of Universal Robots, and behind it moves a robot with
hidden errors, computed by Drake. Everything else is the commands that one would type at a real one; each is printed.
The joints of the program are measured twice, as programmed and as corrected, and a table compares what was expected
with what was achieved. Exit code 1 if the hidden cause is not named, or the achieved error is above 1.2 times the
noise of a single measured pose.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from truepath.calibration import load_calibration
from truepath.errors import TruepathError
from truepath.files import write_atomically
from truepath.lie import Array
from truepath.planning.pose_list import PoseList, to_csv
from truepath.plants import models_dir
from truepath.readers import read_measurements
from truepath.rewriting.rewrite import rewrite_program
from truepath.virtual.controller.addresses import checked_loopback
from truepath.virtual.controller.process import ControllerProcess
from truepath.virtual.hidden_causes import draw_causes, true_poses
from truepath.virtual.real_robot import Imperfection, RealRobot
from truepath.virtual.visits import Visits

CELL = "ur5_cell"
VISITS = 2  # of each target, so that the mean of few targets is not a matter of luck
DEPLOY_SPEED_UP = 5.0  # at most: what is seen of a run is as coarse as the robot is faster than the packets
MOST_TIMES_NOISE = 1.2


@dataclass(frozen=True)
class Achieved:
    """How far the reflector was from where the program means it to be, ``(N,)`` each.

    Attributes:
        measured_mm: by the tracker, every visit with the noise of its reading.
        true_mm: by Drake, all hidden errors at work.
    """

    measured_mm: Array
    true_mm: Array


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("truepath-loop"), help="folder for the results")
    parser.add_argument("--program", type=Path, default=models_dir() / "ur5" / "weld.script")
    parser.add_argument("--poses", type=int, default=100, help="measurements to learn from")
    parser.add_argument("--seed", type=int, default=7, help="of the robot's hidden errors")
    parser.add_argument("--hide", default="joint_compliance", help="cause that is hidden besides, or none")
    parser.add_argument("--noise-mm", type=float, default=0.02, help="of the tracker, per coordinate of a reading")
    parser.add_argument("--speed-up", type=float, default=20.0, help="how much faster the virtual robot lives")
    parser.add_argument("--address", default="127.0.0.1", help="loopback address of the virtual controller")
    options = parser.parse_args(arguments)
    try:
        checked_loopback(options.address)
        options.output.mkdir(parents=True, exist_ok=True)
        return Loop(options).run()
    except (TruepathError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except subprocess.CalledProcessError as error:
        print(f"error: the command above ended with exit code {error.returncode}", file=sys.stderr)
        return 2 if error.returncode == 2 else 1


class Loop:
    """One run, from the plan to the last measurement. Everything that it writes lies in one folder."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options, self.folder = options, options.output
        self.program = options.program.resolve()
        self.causes = () if options.hide == "none" else (options.hide,)
        self.real = RealRobot(CELL, options.seed)  # the truth, for the table at the end
        self.hidden = list(draw_causes(self.real, self.causes).values())
        for name in ("measured", "as_programmed", "as_corrected"):  # record does not overwrite
            for ending in (".csv", ".csv.progress.json"):
                (self.folder / f"{name}{ending}").unlink(missing_ok=True)

    def run(self) -> int:
        """The steps; the exit code."""
        began, options = time.monotonic(), self.options
        by = ("--calibration", "calibration.json")
        self._truepath("plan", "--robot", CELL, "--poses", options.poses, "--effects", options.hide, "-o", "plan.csv")
        with self._controller(options.speed_up):
            self._record("plan.csv", "measured.csv")
            states = ("--measured-in", "world", "--probe", "model")
            self._truepath("diagnose", "measured.csv", "--robot", CELL, *states, "-o", ".")
            calibration = load_calibration(self.folder / "calibration.json")
            rewritten = rewrite_program(self.program, calibration)
            programmed, corrected = rewritten.plan.q_rad, rewritten.correction.q_rad
            self._visit(programmed, "as_programmed")
        with self._controller(min(options.speed_up, DEPLOY_SPEED_UP)):
            self._truepath("correct", self.program, *by, "-o", "corrected.script")
            self._truepath("preview", self.program, *by, "-o", "preview.html")
            host = ("--robot-host", options.address, "--start-within-deg", 360)  # nothing stands in a virtual way
            self._truepath("deploy", "corrected.script", *by, *host, "-o", "run.csv", "--yes")
        with self._controller(options.speed_up):
            self._visit(corrected, "as_corrected")
        wanted = self._wanted(programmed)
        predicted = calibration.model.predict(np.concatenate([programmed, corrected]))[:, :3, 3]
        predicted_mm = 1e3 * np.linalg.norm(predicted - np.tile(wanted, (2, 1)), axis=1).reshape(2, -1)
        before = self._achieved("as_programmed", programmed, wanted)
        after = self._achieved("as_corrected", corrected, wanted)
        diagnosis = json.loads((self.folder / "diagnosis.json").read_text(encoding="utf-8"))
        summary = self._summary(before, after, predicted_mm, diagnosis)
        summary["seconds"] = time.monotonic() - began
        write_atomically(self.folder / "loop.json", json.dumps(summary, indent=1) + "\n")
        _print_table(summary, self.folder)
        return 0 if summary["good"] else 1

    def _summary(self, before: Achieved, after: Achieved, predicted_mm: Array, diagnosis: dict) -> dict[str, Any]:
        named = sorted({finding["effect"] for finding in diagnosis["findings"]})
        noise_mm = self._noise_of_a_pose_mm()
        ratio = float(after.measured_mm.mean() / noise_mm)
        heldout = diagnosis["stages"][-1]["heldout_mm"]
        return {
            "schema": "truepath.closed_loop/1",
            "hidden": sorted(self.causes),
            "named": named,
            "noise_of_a_pose_mm": noise_mm,
            "heldout_mm": heldout,
            "as_programmed": _figures(predicted_mm[0], before),
            "as_corrected": _figures(predicted_mm[1], after),
            "achieved_over_noise": ratio,
            "good": bool(ratio <= MOST_TIMES_NOISE and named == sorted(self.causes)),
        }

    def _controller(self, speed_up: float) -> ControllerProcess:
        """The same robot each time: its errors come from the seed."""
        options = self.options
        return ControllerProcess(
            options.address,
            robot=CELL,
            seed=options.seed,
            hide=self.causes,
            noise_mm=options.noise_mm,
            speed_up=speed_up,
        )

    def _truepath(self, *words: object) -> None:
        """A command as one would type it, in the folder of the results."""
        command = ["truepath", *(str(word) for word in words)]
        print(f"\n$ {shlex.join(command)}", flush=True)
        subprocess.run([sys.executable, "-m", "truepath", *command[1:]], cwd=self.folder, check=True)

    def _record(self, poses: str, output: str) -> None:
        host = ("--robot-host", self.options.address, "--tracker", "simulated", "--robot", CELL)
        pace = ("--speed-deg", 60, "--acceleration-deg", 120, "--settle-s", 0.05, "--measure-s", 0.1)
        anywhere = ("--yes", "--first-move-deg", 360)  # nothing stands in the way of a virtual robot
        self._truepath("record", poses, *host, *pace, "-o", output, *anywhere)

    def _visit(self, q_rad: Array, name: str) -> None:
        """Measures the targets of a program, each a few times, one round after the other."""
        rounds = np.tile(q_rad, (VISITS, 1))
        pose_id = np.tile(np.arange(len(q_rad)), VISITS)
        write_atomically(self.folder / f"{name}_poses.csv", to_csv(PoseList(rounds, pose_id >= 0, pose_id)))
        self._record(f"{name}_poses.csv", f"{name}.csv")

    def _wanted(self, q_rad: Array) -> Array:
        """``(N, 3)`` p_WE: where the drawing has the reflector at the joints ``(N, n)`` of a program, by Drake."""
        drawn = RealRobot(CELL, 0, Imperfection(0.0, 0.0, 0.0, 0.0, 0.0))
        return drawn.reflector_poses(q_rad)[:, :3, 3]

    def _achieved(self, name: str, q_rad: Array, wanted: Array) -> Achieved:
        rows = read_measurements(self.folder / f"{name}.csv", self.real.robot)
        target = np.abs(rows.q_rad[:, None] - q_rad).sum(axis=2).argmin(axis=1)  # poses that were skipped come later
        measured = np.linalg.norm(rows.p_ME - wanted[target], axis=1)
        return Achieved(1e3 * measured, 1e3 * np.linalg.norm(self._truth(q_rad) - wanted, axis=1))

    def _noise_of_a_pose_mm(self) -> float:
        """Mean distance of what was recorded from where the reflector truly was, over the campaign."""
        rows = read_measurements(self.folder / "measured.csv", self.real.robot)
        return float(1e3 * np.linalg.norm(rows.p_ME - self._truth(rows.q_rad), axis=1).mean())

    def _truth(self, q_rad: Array) -> Array:
        return true_poses(self.real, Visits.of(self.real, q_rad), self.hidden)[:, :3, 3]


def _figures(predicted_mm: Array, achieved: Achieved) -> dict[str, dict[str, float]]:
    errors = {"predicted_mm": predicted_mm, "measured_mm": achieved.measured_mm, "true_mm": achieved.true_mm}
    return {name: {"mean": float(mm.mean()), "max": float(mm.max())} for name, mm in errors.items()}


def _print_table(summary: dict[str, Any], folder: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="\nreflector against where the program means it to be, mm", title_justify="left")
    table.add_column("")
    for name in ("predicted mean", "max", "measured mean", "max", "true mean", "max"):
        table.add_column(name, justify="right")
    for key, name in (("as_programmed", "nominal: as programmed"), ("as_corrected", "achieved: as corrected")):
        cells = [f"{summary[key][error][how]:.3f}" for error in ("predicted_mm", "measured_mm", "true_mm")
                 for how in ("mean", "max")]  # fmt: skip
        table.add_row(name, *cells)
    console = Console(highlight=False, width=120)
    console.print(table)
    hidden, named = (", ".join(summary[key]) or "nothing" for key in ("hidden", "named"))
    console.print(f"held-out error of the calibration {summary['heldout_mm']['mean']:.3f} mm")
    console.print(f"hidden besides errors of the frames: {hidden}; named: {named}")
    console.print(
        f"achieved error {summary['achieved_over_noise']:.2f} times the noise of a single pose, "
        f"{summary['noise_of_a_pose_mm']:.4f} mm (at most {MOST_TIMES_NOISE:g}); {summary['seconds']:.0f} s"
    )
    console.print(f"open in a browser: {(folder / 'report.html').resolve()} and {(folder / 'preview.html').resolve()}")


if __name__ == "__main__":
    sys.exit(main())
