"""A virtual controller with its tracker for the tests of recording."""

import os

import numpy as np
import pytest
from truepath.planning.pose_list import PoseList, to_csv
from truepath.virtual.controller.process import ControllerProcess
from virtual_robot import HIDDEN, HOME, SEED

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])


@pytest.fixture(scope="module")
def controller():
    """Lives twenty times faster than the clock on the wall, has play in its gears, and stands at home at first."""
    with ControllerProcess(
        f"127.0.2.{70 + WORKER}", seed=SEED, hide=HIDDEN, speed_up=20.0, tracker_rate_hz=200.0
    ) as process:
        yield process


@pytest.fixture
def at_home(controller):
    """That controller with nothing wrong, its arm at home."""
    controller.command({"do": "recover"})
    controller.command({"do": "set", "remote_control": True, "payload_kg": 1.03, "q_rad": HOME.tolist()})
    return controller


@pytest.fixture
def poses(tmp_path):
    """A list of four visits with a place to pass after the first; begins at home. And its file."""
    away = np.random.default_rng(3).uniform(-0.3, 0.3, (4, 6))
    q = HOME + np.concatenate([np.zeros((1, 6)), away])
    listed = PoseList(q, np.array([1, 0, 1, 1, 1], bool), np.array([0, -1, 1, 2, 3]))
    (tmp_path / "poses.csv").write_text(to_csv(listed))
    return listed, tmp_path / "poses.csv"
