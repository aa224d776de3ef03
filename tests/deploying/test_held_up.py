"""What keeps a watcher from watching: it was held up, its client died, the disk is full."""

import os
import signal
import time

import numpy as np
import pytest
from truepath.deploying.follow import send_and_follow
from truepath.deploying.passages import Passages
from truepath.deploying.run_file import RunFile
from truepath.deploying.stall import Stall

FAR = "def far():\n  movej([1.5, -1.57, 1.57, -1.57, -1.57, 0], a=1.4, v=0.05)\nend\n"
WAITS = "def waits():\n  sleep(4)\nend\n"


@pytest.fixture
def followed(link, way_of):
    """Function: how a program went, something having been done once when the robot moved."""

    def followed(when_it_moves, text=FAR, record=None, stall=Stall(5.0)):  # noqa: B008 - it is frozen
        acted = []

        def watched(passed, state):
            if not acted and np.abs(state.q_rad[0]) > 0.02:
                acted.append(True)
                when_it_moves()

        with record or RunFile(None) as rows:
            passages = Passages(np.zeros((0, 6)), np.zeros(0))
            return send_and_follow(link, text, passages, way_of(text), rows, stall, watched)

    return followed


def was_stopped_on_the_way(controller):
    state = controller.command({"do": "state"})
    return state["program"] is None and 0.01 < state["commanded_q_rad"][0] < 1.4


def test_a_watcher_that_was_held_up_finds_the_robot_stopped_and_says_so(controller, followed, monkeypatch):
    for place in ("robot_link.guard", "deploying.follow"):
        monkeypatch.setattr(f"truepath.{place}.SILENCE_S", 0.7)
    found = []

    def hold_up():
        time.sleep(1.3)
        found.append(was_stopped_on_the_way(controller))

    outcome = followed(hold_up)
    assert found == [True]
    assert "held up for" in outcome.ended
    assert outcome.ended.endswith("it was told to stop and stands")
    assert not outcome.completed


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["ends", "freezes"])
def test_a_reading_client_that_is_no_more_is_a_lost_connection(controller, link, followed, monkeypatch, how):
    monkeypatch.setattr(link, "timeout_s", 0.5)
    outcome = followed(lambda: os.kill(link._reading.pid, how))
    assert "the connection was lost" in outcome.ended
    assert outcome.ended.endswith("it was told to stop and stands")
    assert was_stopped_on_the_way(controller)


def test_a_full_disk_stops_the_robot_and_what_was_seen_is_told(controller, followed, tmp_path):
    record = RunFile(tmp_path / "run.csv")

    def fill():
        record._file = open("/dev/full", "w")  # noqa: SIM115 - the run closes it

    outcome = followed(fill, record=record)
    assert outcome.ended.startswith("the record cannot be written (No space left on device)")
    assert outcome.ended.endswith("it was told to stop and stands")
    assert outcome.samples > 0
    assert was_stopped_on_the_way(controller)


def test_a_robot_that_may_wait_is_told_of_and_left_to_wait(controller, followed):
    told = []
    outcome = followed(lambda: None, text=WAITS, stall=Stall(0.3, told.append))
    assert outcome.completed
    assert told
    assert "has stood" in told[0]
