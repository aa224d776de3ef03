"""Where does the tool of a corrected program really go? Real robots and their controllers are played by Drake.

Robots with hidden errors of their geometry, soft joints and uneven gears are measured, diagnosed and calibrated.
Scripts with random targets, straight lines of 400 mm and arcs are corrected, run by a controller with kinematics of its
own, and the real tool is held against what was meant. Prints a table; exits with 1 if something asked for is missed.

    .venv/bin/python workflows/path_accuracy.py [--robots 3] [--targets 2000] [--lines 40] [--arcs 20] [--json FILE]
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

TRUTH = Path(__file__).resolve().parents[1] / "tests" / "rewriting"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--robots", type=int, default=3, help="robots with different hidden errors")
    parser.add_argument("--first-seed", type=int, default=3)
    parser.add_argument("--poses", type=int, default=300, help="measured, with 0.02 mm noise")
    parser.add_argument("--targets", type=int, default=2000)
    parser.add_argument("--lines", type=int, default=40)
    parser.add_argument("--arcs", type=int, default=20)
    parser.add_argument("--tolerance-mm", type=float, default=0.05)
    parser.add_argument("--json", type=Path, default=None, help="file to write")
    options = parser.parse_args(arguments)
    sys.path.insert(0, str(TRUTH))
    truth, figures = importlib.import_module("path_truth"), importlib.import_module("path_figures")
    robots: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.first_seed, options.first_seed + options.robots):
            cell = truth.Cell(seed, options.poses, find_effects=True)
            rows = figures.target_figures(cell, options.targets, Path(folder))
            for kind, count in (("lines", options.lines), ("arcs", options.arcs)):
                rows += figures.stroke_figures(cell, kind, count, options.tolerance_mm, Path(folder))
            found = sorted({effect.name for effect in cell.calibration.effects})
            robots.append({"seed": seed, "effects": found, "figures": [_row(each) for each in rows]})
            _print(robots[-1])
    passed = all(each["passed"] for robot in robots for each in robot["figures"])
    if options.json is not None:
        content = {"schema": "truepath.path_accuracy/1", "passed": passed, "robots": robots}
        options.json.write_text(json.dumps(content, indent=1) + "\n")
    print("all as asked for" if passed else "something asked for is missed")
    return 0 if passed else 1


def _row(figure: Any) -> dict[str, Any]:
    return {**asdict(figure), "passed": figure.passed}


def _print(robot: dict[str, Any]) -> None:
    print(f"robot {robot['seed']}, found: {', '.join(robot['effects'])}")
    for row in robot["figures"]:
        mark = "  " if row["passed"] else "! "
        print(f"{mark}{row['what']:<52}{row['value']:>9.4f} <= {row['limit']:.4f} {row['unit']}")
        if row["detail"]:
            print("      " + ", ".join(f"{name} {value:.4g}" for name, value in row["detail"].items()))
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
