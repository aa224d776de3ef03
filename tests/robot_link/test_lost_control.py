"""Control that was held and is lost: nobody's program is replaced, and nobody's stop overruled."""

import os
import signal
import threading
import time

import numpy as np
import pytest
from truepath.robot_link import ControlLost, RobotFault
from truepath.robot_link import control as control_module
from truepath.robot_link import link as link_module
from truepath.robot_link.text_ports import ask_dashboard, send_program

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
NEAR, FAR = HOME + 0.05, HOME + np.array([1.5, 0, 0, 0, 0, 0])
BRISK, SLOW = (0.5, 1.0), (0.05, 1.0)  # rad/s, rad/s^2
OTHER = "def other():\n  sleep(1000)\nend\n"


@pytest.fixture
def held(link):
    """A link whose robot rests after a move."""
    link.move_joints(NEAR, *BRISK)
    return link


def program(controller):
    return controller.command({"do": "state"})["program"]


def refuses_to_move(controller, link):
    before = controller.command({"do": "state"})["moves"]
    for _ in range(2):
        with pytest.raises(ControlLost, match="stopped or paused at the pendant, or another program"):
            link.move_joints(HOME, *BRISK)
    with pytest.raises(ControlLost):
        link.tcp_offset()
    return controller.command({"do": "state"})["moves"] == before


@pytest.mark.parametrize("word", ["stop", "pause"])
def test_a_robot_that_was_stopped_or_paused_at_rest_stays_so(controller, held, word):
    ask_dashboard(controller.address, word, 1.0)
    time.sleep(0.1)
    assert refuses_to_move(controller, held)


def test_a_program_that_has_taken_the_place_of_ours_goes_on(controller, held):
    send_program(controller.address, OTHER, 1.0)
    time.sleep(0.1)
    assert refuses_to_move(controller, held)
    assert program(controller) == "other"
    held.close()
    assert program(controller) == "other"


@pytest.mark.parametrize("after_s", [0.1, 0.0], ids=["later", "at once"])
def test_a_stop_at_the_pendant_ends_a_move_and_what_is_started_then_goes_on(controller, held, monkeypatch, after_s):
    monkeypatch.setattr(control_module, "PROBE_S", 0.5)

    def act():
        ask_dashboard(controller.address, "stop", 1.0)
        time.sleep(after_s)
        send_program(controller.address, OTHER, 1.0)

    timer = threading.Timer(0.4, act)
    timer.start()
    with pytest.raises(ControlLost):
        held.move_joints(FAR, *SLOW)
    timer.join()
    time.sleep(0.5)
    assert program(controller) == "other"


def test_who_was_late_himself_is_told_so_and_may_take_control_anew(controller, held):
    os.kill(held._control.pid, signal.SIGSTOP)
    time.sleep(1.4)  # longer than the watchdog waits
    os.kill(held._control.pid, signal.SIGCONT)
    assert program(controller) is None
    with pytest.raises(RobotFault, match="was held up for 1") as told:
        held.move_joints(HOME, *BRISK)
    assert not isinstance(told.value, ControlLost)
    held.move_joints(HOME, *BRISK)
    assert np.allclose(controller.command({"do": "state"})["commanded_q_rad"], HOME, atol=1e-6)


def test_a_client_that_dies_at_rest_is_told_and_not_replaced_in_silence(held):
    os.kill(held._control.pid, signal.SIGKILL)
    time.sleep(0.1)
    with pytest.raises(RobotFault, match="the client of the robot has gone"):
        held.move_joints(HOME, *BRISK)
    held.move_joints(HOME, *BRISK)


def test_a_move_that_nobody_watches_ends(controller, held, monkeypatch):
    monkeypatch.setattr(link_module, "WATCHED_EVERY_S", np.inf)
    monkeypatch.setattr(link_module, "SILENCE_S", 1.0)
    with pytest.raises(RobotFault, match="nobody has watched the move for 1 s"):
        held.move_joints(FAR, 0.01, 1.0)
    assert program(controller) is None
    assert controller.command({"do": "state"})["commanded_q_rad"][0] < 1.4
