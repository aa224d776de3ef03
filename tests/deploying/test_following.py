"""What happens to a robot whose program is paused, interrupted or no longer watched."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from guards_left import guards_have_gone
from truepath.deploying.follow import send_and_follow
from truepath.deploying.passages import Passages
from truepath.deploying.run_file import RunFile
from truepath.deploying.stall import Stall
from truepath.robot_link import RobotFault, RobotLink
from truepath.robot_link.text_ports import ask_dashboard

FAR = "def far():\n  movej([1.5, -1.57, 1.57, -1.57, -1.57, 0], a=1.4, v=0.1)\nend\n"
SHORT = "def short():\n  movej([0.15, -1.57, 1.57, -1.57, -1.57, 0], a=1.4, v=0.05)\nend\n"
MOVES_RAD = 0.02


@pytest.fixture
def followed(way_of):
    """Function: how a program went, something having been done when the robot moved."""

    def followed(link, text, when_it_moves, rehearsed=None):
        return follow(link, text, way_of(rehearsed or text), when_it_moves)

    return followed


def follow(link, text, way, when_it_moves):
    acted = []

    def watched(passed, state):
        if not acted and np.abs(state.q_rad[0]) > MOVES_RAD:
            acted.append(True)
            when_it_moves()

    with RunFile(None) as nothing:
        no_targets = Passages(np.zeros((0, 6)), np.zeros(0))
        return send_and_follow(link, text, no_targets, way, nothing, Stall(5.0), watched)


def is_over(controller, within_s=0.0):
    end = time.monotonic() + within_s
    while (state := controller.command({"do": "state"}))["program"] is not None and time.monotonic() < end:
        time.sleep(0.02)
    time.sleep(0.1)
    now = controller.command({"do": "state"})
    return state["program"] is None and now["commanded_q_rad"] == state["commanded_q_rad"]


def test_a_pause_is_not_the_end(controller, link, followed):
    paused = []

    def pause():
        ask_dashboard(link.host, "pause", 1.0)
        paused.append(controller.command({"do": "state"})["commanded_q_rad"][0])
        threading.Timer(0.8, lambda: ask_dashboard(link.host, "play", 1.0)).start()

    outcome = followed(link, SHORT, pause)
    assert outcome.completed
    assert paused[0] < 0.14
    assert controller.command({"do": "state"})["commanded_q_rad"][0] == pytest.approx(0.15)


def test_a_dashboard_that_refuses_and_an_impatient_person_do_not_keep_the_robot_going(
    controller, link, followed, monkeypatch
):
    monkeypatch.setattr(RobotLink, "_stop_by_dashboard", lambda self: "Failed to execute: stop")

    def ctrl_c_again_and_again():
        for after_s in (0.1, 0.5, 1.0):
            threading.Timer(after_s, os.kill, (os.getpid(), signal.SIGINT)).start()
        signal.raise_signal(signal.SIGINT)

    outcome = followed(link, FAR, ctrl_c_again_and_again)
    assert outcome.interrupted
    assert outcome.ended.endswith("it was told to stop and stands")
    assert is_over(controller)
    assert controller.command({"do": "state"})["commanded_q_rad"][0] < 1.4


def test_what_obeys_nobody_is_told_as_it_is(controller, link, followed, monkeypatch):
    for way in ("_stop_by_dashboard", "_stop_by_program", "_stop_by_control"):
        monkeypatch.setattr(RobotLink, way, lambda self: "Stopped")
    monkeypatch.setattr("truepath.robot_link.link.STOP_LIMIT_S", 0.0)

    def fails():
        raise RobotFault("nothing is known")

    outcome = followed(link, FAR, fails)
    assert "it still moves, and its program has not ended" in outcome.ended
    assert outcome.ended.endswith(
        "a process in the background goes on telling it to stop, for an hour or until it does"
    )
    assert not outcome.completed
    assert is_over(controller, within_s=5.0)  # the guard goes on trying
    assert guards_have_gone(controller.address)


def test_a_program_whose_watcher_was_killed_is_stopped(controller, link):
    watcher = (
        "import sys, time\nfrom truepath.robot_link.guard import Guard\n"
        f"with Guard({link.host!r}):\n  print('there', flush=True)\n  time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", watcher], stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"there\n"
        link.send_program(FAR)
        while not link.state().program_running:
            time.sleep(0.01)
        process.kill()
    assert is_over(controller, within_s=5.0)
    assert controller.command({"do": "state"})["commanded_q_rad"][0] < 1.4
    assert guards_have_gone(controller.address)


def test_nothing_is_sent_while_the_dashboard_is_silent(controller, link, followed, monkeypatch):
    def silent(self, question):
        raise RobotFault(f"the dashboard does not answer {question!r}")

    monkeypatch.setattr(RobotLink, "dashboard", silent)
    with pytest.raises(RobotFault, match="is in remote control"):
        followed(link, FAR, lambda: None)
    assert controller.moves() == 0


def test_a_robot_that_leaves_the_rehearsed_way_is_stopped(controller, link, followed):
    other_way_round = FAR.replace("[1.5,", "[-1.5,")
    outcome = followed(link, other_way_round, lambda: None, rehearsed=FAR)
    assert "has left the way" in outcome.ended
    assert "joint 1" in outcome.ended
    assert outcome.ended.endswith("it was told to stop and stands")
    assert not outcome.completed
    assert -0.4 < controller.command({"do": "state"})["commanded_q_rad"][0] < -0.05
