"""The whole command on a long program, start-up included, and where its time goes: a part of benchmark.py.

    .venv/bin/python workflows/program_benchmark.py [--lines 100000] [--cell none]

Makes a welding program of so many ``movel`` lines and a calibration with two named effects on the built-in virtual
cell, runs ``truepath correct`` on it as a process of its own, then the same steps in this process, timed one by one.
``parse_and_write_share`` is the part of reading and writing in the latter. Prints JSON.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

CELL = "ur5_cell"
LINE = "  movel(p[%.6f, %.6f, %.6f, %.6f, %.6f, %.6f], a=1.2, v=0.05, r=0.0005)\n"
PARSE_AND_WRITE = ("reading the program", "writing")


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--lines", type=int, default=100_000)
    parser.add_argument("--cell", default=CELL, help="in which collisions are looked for; none: nowhere")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(measure(Path(folder), options.lines, options.cell)))
    return 0


def measure(folder: Path, lines: int, cell: str) -> dict[str, Any]:
    """Seconds of the command, and of its steps."""
    program, calibration, output = folder / "long.script", folder / "calibration.json", folder / "out.script"
    write_program(program, lines)
    calibrate(calibration)
    start = time.perf_counter()
    truepath = str(Path(sys.executable).parent / "truepath")
    command = [truepath, "correct", str(program), "-c", str(calibration), "-o", str(output), "--cell", cell]
    subprocess.run(command, check=True, capture_output=True)
    whole_s = time.perf_counter() - start
    steps = steps_s(program, calibration, output, None if cell == "none" else cell)
    return {
        "lines": lines,
        "bytes": program.stat().st_size,
        "cell": cell,
        "command_s": whole_s,
        "steps_s": steps,
        "parse_and_write_share": sum(steps[name] for name in PARSE_AND_WRITE) / sum(steps.values()),
    }


def steps_s(program: Path, calibration: Path, output: Path, cell: str | None) -> dict[str, float]:
    """Seconds of each step, in this process."""
    from truepath.calibration import load_calibration
    from truepath.files import write_atomically
    from truepath.rewriting.options import RewriteOptions
    from truepath.rewriting.rewrite import rewrite_program

    marks = [("reading the calibration", time.perf_counter())]
    loaded = load_calibration(calibration)
    content = rewrite_program(
        program, loaded, RewriteOptions(cell=cell), say=lambda what: marks.append((what, time.perf_counter()))
    ).content
    write_atomically(output, content)
    ends = [moment for _, moment in marks[1:]] + [time.perf_counter()]
    return {what: end - begun for (what, begun), end in zip(marks, ends, strict=True)}


def write_program(path: Path, lines: int) -> None:
    """Along the welding path of the UR5 cell, in tool poses of the torch."""
    from truepath import lie, plants
    from truepath.controller import controller_of, vectors_from_poses
    from truepath.programs.toolpath_csv import read_toolpath

    robot = plants.load_robot(CELL)
    q_path = read_toolpath(plants.models_dir() / "ur5" / "weld_path.csv", robot.num_joints).q_rad
    assert q_path is not None
    along = np.linspace(0, len(q_path) - 1, lines)
    q = np.stack([np.interp(along, np.arange(len(q_path)), column) for column in q_path.T], axis=1)
    X_0T = lie.make_pose(translation=np.array([0.08, 0.0, 0.16]))
    poses = vectors_from_poses(controller_of(robot).tool_poses(q, X_0T))
    start = ", ".join(f"{each:.6f}" for each in q[0])
    head = f"def weld():\n  set_tcp(p[0.08, 0, 0.16, 0, 0, 0])\n  movej([{start}], a=1.4, v=1.05)\n"
    path.write_text(head + "".join(LINE % tuple(pose) for pose in poses.tolist()) + "end\n")


def calibrate(path: Path) -> None:
    """Of a virtual robot that hides two causes besides its frame errors."""
    from truepath.learn import learn
    from truepath.virtual.hidden_causes import draw_causes
    from truepath.virtual.real_robot import RealRobot
    from truepath.virtual.simulate import Campaign, free_poses, measure

    real = RealRobot(CELL, seed=0)
    causes = draw_causes(real, ("joint_compliance", "transmission_error"))
    data = measure(real, free_poses(real, 200, np.random.default_rng(0)), Campaign(), causes)
    learn(real.robot, data, effects=("joint_compliance", "transmission_error"), source=CELL).calibration.save(path)


if __name__ == "__main__":
    sys.exit(main())
