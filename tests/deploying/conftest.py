"""A virtual controller, a calibration of its robot, and programs that were corrected with it."""

import os
import time
from dataclasses import replace

import numpy as np
import pytest
from truepath.calibration import load_calibration
from truepath.controller import controller_of
from truepath.deploying.rehearsal import rehearse
from truepath.deploying.rehearsed_way import rehearsed_way
from truepath.learn import learn
from truepath.rewriting.options import RewriteOptions
from truepath.rewriting.rewrite import rewrite_program
from truepath.robot_link import RobotLink
from truepath.virtual.controller.process import ControllerProcess
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
HOME = [0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0]
SEED, SPEED_UP = 0, 6.0
TCP, MASS_KG, CENTRE_M = [0.08, 0.0, 0.16, 0.0, 0.0, 0.0], 1.03, [0.03003, 0.0, 0.03626]  # as the cell is drawn
WELD = """def weld():
  set_tcp(p[0.08, 0, 0.16, 0, 0, 0])
  set_payload(1.0, [0.03, 0, 0.036])
  movej([0, -1.5707963, 1.5707963, -1.5707963, -1.5707963, 0], a=1.4, v=1.05)
  sleep(1.5)
  movel(p[-0.525, -0.15, 0.163, -2.221441469, -2.221441469, 0], a=1.2, v=0.25, r=0.01)
  movel(p[-0.525, -0.15, 0.113, -2.221441469, -2.221441469, 0], a=1.2, v=0.25)
  sleep(1.5)
  movel(p[-0.675, -0.15, 0.113, -2.221441469, -2.221441469, 0], a=0.5, v=0.1)
  sleep(1.5)
  movec(p[-0.6, -0.075, 0.113, -2.221441469, -2.221441469, 0], p[-0.525, -0.15, 0.113, -2.221441469, -2.221441469, 0], a=0.5, v=0.25)
  sleep(1.5)
end
"""  # noqa: E501
SLOW = """def slow():
  movej([0, -1.57, 1.57, -1.57, -1.57, 0], a=1.4, v=1.05)
  movej([1, -1.57, 1.57, -1.57, -1.57, 0], a=1.4, v=0.015)
end
"""


@pytest.fixture(scope="session")
def calibration_file(tmp_path_factory):
    """Of the robot behind the controller, measured in the world with a tracker."""
    real = RealRobot("ur5", SEED)
    data = measure(real, free_poses(real, 60, np.random.default_rng(1)), Campaign())
    stated = replace(data, X_MB_nominal=real.robot.X_WB, X_FE_nominal=real.robot.X_FR)
    path = tmp_path_factory.mktemp("calibration") / "calibration.json"
    learn(real.robot, stated, source="ur5_cell", effects=())[0].save(path)
    return path


@pytest.fixture(scope="session")
def calibration(calibration_file):
    return load_calibration(calibration_file)


@pytest.fixture(scope="session")
def corrected(tmp_path_factory, calibration):
    """Function: the file of a program, corrected."""
    folder = tmp_path_factory.mktemp("programs")

    def corrected(text, by=calibration, name="weld.script"):
        (folder / name).write_text(text)
        options = RewriteOptions(path_tolerance_mm=None)
        (folder / f"corrected_{name}").write_bytes(rewrite_program(folder / name, by, options).content)
        return folder / f"corrected_{name}"

    return corrected


@pytest.fixture(scope="session")
def weld(corrected):
    return corrected(WELD)


@pytest.fixture(scope="session")
def slow(corrected):
    """Goes on for a minute of the robot's time."""
    return corrected(SLOW, name="slow.script")


@pytest.fixture(scope="session")
def way_of(ur5):
    """Function: where the joints go in a program that starts from where they are, without a tool."""
    believed = controller_of(ur5)

    def way_of(text, q_start_rad=HOME):
        start = np.array(q_start_rad)
        return rehearsed_way(rehearse(text, believed, start, [0.0] * 6), believed, start)

    return way_of


@pytest.fixture(scope="module")
def process():
    with ControllerProcess(f"127.0.3.{30 + WORKER}", seed=SEED, speed_up=SPEED_UP) as process:
        yield process


@pytest.fixture
def controller(process):
    """The controller as it should be, its arm at home. ``controller.moves()`` counts what has moved since."""
    process.command({"do": "recover"})
    process.command(
        {"do": "set", "remote_control": True, "payload_kg": MASS_KG, "payload_cog_m": CENTRE_M, "tcp_offset": TCP}
    )
    process.command({"do": "set", "q_rad": HOME})
    before = process.command({"do": "state"})["moves"]
    process.moves = lambda: process.command({"do": "state"})["moves"] - before
    return process


@pytest.fixture(scope="module")
def open_link(process):
    with RobotLink(process.address, timeout_s=2.0) as link:
        yield link


@pytest.fixture
def link(controller, open_link):
    """To that controller; it has seen the controller as it is now."""
    now_s = controller.command({"do": "state"})["time_s"]
    while open_link.state().time_s < now_s:
        time.sleep(0.01)
    return open_link
