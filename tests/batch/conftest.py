"""A calibration, small programs, and the workflow run in this process."""

import json
from pathlib import Path

import numpy as np
import pytest
from small_programs import program, workflow
from truepath.learn import learn
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure


def calibrate(path, seed):
    """Learns the virtual robot of that seed."""
    real = RealRobot("ur5", seed)
    data = measure(real, free_poses(real, 60, np.random.default_rng(seed)), Campaign())
    learn(real.robot, data, source="ur5", effects=()).calibration.save(path)
    return path


@pytest.fixture(scope="session")
def calibration(tmp_path_factory):
    return calibrate(tmp_path_factory.mktemp("calibration") / "one.json", 21)


@pytest.fixture(scope="session")
def other_calibration(tmp_path_factory):
    return calibrate(tmp_path_factory.mktemp("calibration") / "two.json", 22)


@pytest.fixture
def programs(tmp_path):
    """Function: writes programs by name, with text or with a seed, and returns their folder."""

    def programs(**texts):
        for name, text in texts.items():
            file = tmp_path / "programs" / f"{name.replace('__', '/')}.script"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text if isinstance(text, str) else program(text))
        return tmp_path / "programs"

    return programs


class Done:
    """A run of the workflow."""

    def __init__(self, code, out, err, folder):
        self.code, self.out, self.err, self.folder = code, out, err, folder

    @property
    def summary(self):
        return json.loads((self.folder / "batch.json").read_text())

    def statuses(self):
        return {Path(each["program"]).stem: each["status"] for each in self.summary["programs"]}

    def done_now(self):
        """Names of programs whose results this run has written."""
        return {Path(each["program"]).stem for each in self.summary["programs"] if each["writes"]}


@pytest.fixture
def batch(tmp_path, capsys):
    """Function: runs the workflow with one worker unless told otherwise; results go to ``corrected``."""

    def batch(source, *options, workers=1):
        folder = tmp_path / "corrected"
        who = () if workers is None else ("--workers", workers)
        try:
            code = workflow().main([*map(str, (source, "--output", folder, *who, *options))])
        except SystemExit as stop:  # argparse
            code = stop.code
        captured = capsys.readouterr()
        return Done(code, captured.out, captured.err, folder)

    return batch
