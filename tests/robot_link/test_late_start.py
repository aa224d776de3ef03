"""Programs that start a while after they were sent: whoever wants an end meanwhile gets it, also of those.

Two connections can overtake each other: the word to stop may be there before what it is to stop.
"""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from guards_left import guards_have_gone
from slow_network import SlowNetwork
from truepath.robot_link import RobotLink
from truepath.robot_link import control as control_module
from truepath.robot_link import link as link_module
from truepath.robot_link.interruptions import interruptible

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
FRONT = f"127.0.2.{150 + WORKER}"
WALK = "def walk():\n  movej([1.5, -1.57, 1.57, -1.57, -1.57, 0], a=1, v=0.01)\nend\n"
OVERTAKEN = (0.7, 0.0)


@pytest.fixture
def network(controller, link):
    """Function: the address of a controller behind a slow network."""
    opened = []

    def network(delays_s):
        opened.append(SlowNetwork(FRONT, controller.address, delays_s).__enter__())
        return opened[0]

    yield network
    for each in opened:
        each.__exit__()


def began(controller, name, before):
    return sum(f"program {name} starts" in line for line in controller.log()) - before


def is_over(controller):
    """Whether no program runs, and none starts during a while."""
    for _ in range(6):
        state = controller.command({"do": "state"})
        if state["program"] is not None or np.abs(state["speed_rad_s"]).max() > 0:
            return False
        time.sleep(0.05)
    return True


def test_a_program_that_starts_after_the_stop_is_stopped_too(controller, network, monkeypatch):
    monkeypatch.setattr(link_module, "STARTS_WITHIN_S", 1.1)
    before = began(controller, "walk", 0)
    with RobotLink(network(OVERTAKEN).front, timeout_s=2.0) as link:
        link.send_program(WALK)
        assert began(controller, "walk", before) == 0
        link.stop()
        assert began(controller, "walk", before) == 1
    assert is_over(controller)


def test_one_whose_sender_is_killed_at_once_is_stopped(controller, network):
    slow = network(OVERTAKEN)
    sender = (
        "import sys, time\nfrom truepath.robot_link.guard import Guard\n"
        "from truepath.robot_link.text_ports import send_program\n"
        f"with Guard({slow.front!r}) as guard:\n  guard.is_sending(1.1)\n"
        f"  send_program({slow.front!r}, {WALK!r}, 2.0)\n  time.sleep(60)\n"
    )
    before = began(controller, "walk", 0)
    with subprocess.Popen([sys.executable, "-c", sender]) as process:
        assert slow.sent.wait(20.0)
        process.kill()
    assert guards_have_gone(FRONT)
    assert began(controller, "walk", before) == 1
    assert is_over(controller)


def test_a_control_script_whose_client_is_interrupted_meanwhile_does_not_stay(controller, network, monkeypatch):
    monkeypatch.setattr(control_module, "LATE_SCRIPT_S", 1.0)
    slow = network(OVERTAKEN)
    before = began(controller, "rtde_control", 0)

    def interrupt():
        slow.sent.wait(20.0)
        time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    impatient = threading.Thread(target=interrupt)
    with RobotLink(slow.front, timeout_s=2.0) as link:
        link.state()
        impatient.start()
        with interruptible(), pytest.raises(KeyboardInterrupt):
            link.tcp_offset()
        impatient.join()
    assert began(controller, "rtde_control", before) == 1
    assert is_over(controller)


def test_nor_does_one_whose_client_is_killed(controller, network):
    slow = network(OVERTAKEN)
    asks = (
        "from truepath.robot_link import RobotLink, control\ncontrol.LATE_SCRIPT_S = 1.0\n"
        f"RobotLink({slow.front!r}).tcp_offset()\n"
    )
    before = began(controller, "rtde_control", 0)
    with subprocess.Popen([sys.executable, "-c", asks]) as process:
        assert slow.sent.wait(20.0)
        process.kill()
    assert guards_have_gone(FRONT)
    assert began(controller, "rtde_control", before) == 1
    assert is_over(controller)
