"""A few of the runs of ``workflows/record_faults.py``, and that its judge is none who lets everything pass."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from truepath.virtual.controller.process import ControllerProcess

sys.path.insert(0, str(Path(__file__).parents[2] / "workflows"))

import record_faults
from recording_faults.rows import Truth, complete_rows, what_is_wrong

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
SEED, POSES = 5, 2


@pytest.fixture(scope="module")
def truth():
    return Truth(SEED, record_faults.HIDDEN)


@pytest.fixture(scope="module")
def run(tmp_path_factory, truth):
    """A recording that is killed and resumed; the folder, and what was found."""
    folder = tmp_path_factory.mktemp("runs")
    options = {"seed": SEED, "hide": record_faults.HIDDEN, "speed_up": record_faults.SPEED_UP, "tracker_rate_hz": 100.0}
    with ControllerProcess(f"127.0.2.{80 + WORKER}", **options) as controller:
        return folder, record_faults.one_run(controller, truth, folder / "kill", 0, POSES, "kill")


def test_nothing_is_lost_and_nothing_invented(run):
    _, result = run
    assert result["wrong"] == []
    assert result["exit_codes"] == [-9, 0]
    assert result["rows_at_interruptions"][0] >= result["after_rows"] > 0


def test_the_judge_sees_every_kind_of_fault(run, truth, tmp_path):
    folder, _ = run
    listed = record_faults.short_list(np.random.default_rng([0, 1]), POSES)
    path = tmp_path / "data.csv"
    good = complete_rows(folder / "kill" / "data.csv")

    def judged(lines, kept=()):
        path.write_bytes(b"".join(lines))
        return " ".join(what_is_wrong(path, kept, listed, truth))

    def with_cell(line, column, value):
        cells = line.decode().strip().split(",")
        cells[good[0].decode().strip().split(",").index(column)] = value
        return (",".join(cells) + "\n").encode()

    assert judged(good, [good[:2]]) == ""
    assert "recorded 0 times" in judged(good[:-1])
    assert "recorded 2 times" in judged([*good, good[-1]])
    assert "not there any more" in judged(good, [[*good[:1], good[2]]])
    once = good[2]  # a pose that is visited once
    assert "other joints" in judged([*good[:2], with_cell(once, "q1_rad", "0.5"), *good[3:]])
    x_mm = float(once.split(b",")[6])
    shifted = with_cell(once, "x_mm", f"{x_mm + 0.1:.6f}")
    assert "from where the robot was" in judged([*good[:2], shifted, *good[3:]])
