"""Signals of an impatient person, and children whose parent was killed."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from truepath.robot_link import RobotFault
from truepath.robot_link.interruptions import deferred, interruptible, uninterrupted
from truepath.robot_link.readiness import is_in_remote_control

ADDRESS = "127.0.8.90"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP])
def test_the_first_signal_interrupts_and_the_next_ones_are_nothing(number):
    before = signal.getsignal(number)
    with interruptible():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
        signal.raise_signal(number)
    assert signal.getsignal(number) is before


def test_a_job_in_the_background_can_be_interrupted():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with pytest.raises(KeyboardInterrupt), interruptible():
            signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_who_asked_to_outlive_the_terminal_does():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interruptible():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_what_must_be_done_is_done_before_the_interruption():
    done = []

    def tidy_up():
        with deferred():
            signal.raise_signal(signal.SIGINT)
            done.append("deferred")

    with interruptible(), pytest.raises(KeyboardInterrupt):
        tidy_up()
    with interruptible(), uninterrupted():
        signal.raise_signal(signal.SIGINT)
        done.append("uninterrupted")
    assert done == ["deferred", "uninterrupted"]


def children_of(pid):
    listed = Path(f"/proc/{pid}/task/{pid}/children")
    return [int(child) for child in listed.read_text().split()] if listed.exists() else []


def is_alive(pid):
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and stat.read_text().rsplit(")", 1)[1].split()[0] != "Z"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux tells a child of its parent's death")
def test_a_client_that_is_about_to_take_control_dies_with_its_parent():
    """Else it would upload its script to a robot that nobody watches: it waits for an answer, deaf to everything."""
    asks = f"from truepath.robot_link import RobotLink\nRobotLink({ADDRESS!r}).tcp_offset()\n"
    with socket.create_server((ADDRESS, 30004)) as server, socket.create_server((ADDRESS, 29999)):
        server.settimeout(20.0)
        parent = subprocess.Popen([sys.executable, "-c", asks])
        visited, _ = server.accept()
        guard, child = sorted(children_of(parent.pid))
        os.kill(parent.pid, signal.SIGKILL)
        parent.wait()
        end = time.monotonic() + 3.0
        while is_alive(child) and time.monotonic() < end:
            time.sleep(0.02)
        visited.close()
        os.kill(guard, signal.SIGKILL)  # nobody is there whom it could tell to stop
        assert not is_alive(child)


@pytest.mark.parametrize(
    ("answer", "remote"),
    [("true", True), ("False", False), ('could not understand: "is in remote control"', None)],
)
def test_a_controller_may_not_know_whether_it_is_in_remote_control(answer, remote):
    assert is_in_remote_control(SimpleNamespace(dashboard=lambda question: answer)) is remote


@pytest.mark.parametrize("answer", ["", "perhaps", "Failed to execute: is in remote control"])
def test_a_dashboard_that_evades_the_question_is_no_consent(answer):
    with pytest.raises(RobotFault, match="does not say"):
        is_in_remote_control(SimpleNamespace(dashboard=lambda question: answer))
