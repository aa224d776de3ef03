"""A calibration, a program to correct with it, and the command that does so."""

from dataclasses import replace

import numpy as np
import pytest
from command import run
from drake_arm import DrakeArm
from truepath.learn import learn
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure
from urscript_poses import HOME, TOOL, written


@pytest.fixture(scope="session")
def arm():
    return DrakeArm("ur5")


@pytest.fixture(scope="session")
def poses(arm):
    """Three tool poses, 200 mm apart, with a tool of 120 mm."""
    first = (arm.flange_poses(np.array([HOME])) @ TOOL)[0]
    poses = []
    for step in ([0, 0, 0], [0, 0.2, 0], [0.1, 0.2, -0.15]):
        X = first.copy()
        X[:3, 3] += step
        poses.append(written(X))
    return poses


@pytest.fixture(scope="session")
def calibration(tmp_path_factory):
    real = RealRobot("ur5_cell", seed=4)
    data = measure(real, free_poses(real, 100, np.random.default_rng(0)), Campaign())
    stated = replace(data, X_MB_nominal=real.robot.X_WB, X_FE_nominal=real.robot.X_FR)
    path = tmp_path_factory.mktemp("calibration") / "ur5.json"
    learn(real.robot, stated, source="ur5_cell").calibration.save(path)
    return path


@pytest.fixture
def correct(monkeypatch, capsys, calibration, tmp_path):
    """Runs the command on a program text; its output is ``out.script``, of a toolpath ``out.csv``."""

    def correct(text, *options, name="weld.script", output=True):
        program = tmp_path / name
        program.write_bytes(text if isinstance(text, bytes) else text.encode())
        target = ("-o", tmp_path / ("out.csv" if name.endswith(".csv") else "out.script")) if output else ()
        return run(monkeypatch, capsys, "correct", program, "-c", calibration, *target, *options)

    return correct


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.script"


@pytest.fixture
def weld(poses):
    return f"""def weld():  # made for robot: UR5
  set_tcp(p[0, 0, 0.12, 0, 0, 0])
  movej({HOME}, a=1.4, v=1.05)  # home
  movel({poses[1]}, a=1.2, v=0.1, r=0.002)
  set_digital_out(0, True)
  movel({poses[2]}, a=1.2, v=0.1)
end
"""
