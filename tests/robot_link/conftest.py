"""A virtual controller for the tests of the link."""

import math
import os

import pytest
from truepath.robot_link import RobotLink
from truepath.virtual.controller.process import ControllerProcess

HOME = [0.0, -math.pi / 2, math.pi / 2, -math.pi / 2, -math.pi / 2, 0.0]
WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])


@pytest.fixture(scope="module")
def controller():
    """Lives twenty times faster than the clock on the wall."""
    with ControllerProcess(f"127.0.2.{50 + WORKER}", speed_up=20.0) as process:
        yield process


@pytest.fixture(scope="module")
def only_link(controller):
    with RobotLink(controller.address, timeout_s=2.0) as link:
        yield link


@pytest.fixture
def link(controller, only_link):
    """A link to it; whatever happened to the robot before is over, and it is at home."""
    only_link.give_control_back()
    controller.command({"do": "recover"})
    controller.command({"do": "stop"})
    controller.command({"do": "set", "q_rad": HOME})
    return only_link
