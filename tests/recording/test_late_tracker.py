"""``truepath record`` with a tracker that is always late, or frozen, and with a robot that is in use."""

import contextlib
import queue
import socket
import threading
import time

import numpy as np
import pytest
from command import is_refused
from served import server
from truepath.measurements import from_table
from truepath.planning.pose_list import PoseList, robot_mark, to_csv
from truepath.plants import load_robot
from truepath.recording.row_file import progress_file
from truepath.tables import read_table
from truepath.virtual.hidden_causes import draw_causes, true_poses
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.visits import Visits
from virtual_robot import HIDDEN, HOME, SEED

BRISK = ("--settle-s", 0.1, "--measure-s", 0.1, "--speed-deg", 40, "--acceleration-deg", 120, "--robot", "ur5_cell")
LATE_S = 0.6  # longer than it takes from one pose to the reading at the next
EVERY_S = 0.2


@pytest.fixture
def record(truepath, poses, tmp_path, at_home):
    def record(tracker, *more, yes="--yes"):
        places = ("--robot-host", at_home.address, "--tracker", tracker, "-o", tmp_path / "data.csv")
        return truepath("record", poses[1], *places, *BRISK, *([yes] if yes else []), *more)

    return record


def delayed(controller):
    """Serves some of what the controller's tracker says, so much later."""

    def serve(connection):
        waiting = queue.Queue()
        threading.Thread(target=send, args=(connection, waiting), daemon=True).start()
        next_s = 0.0
        with socket.create_connection((controller.address, controller.tracker_port)) as source:
            for line in source.makefile("rb"):
                now_s = time.monotonic()
                if now_s >= next_s or not line[:1].isdigit():  # the header must come
                    waiting.put((now_s + LATE_S, line))
                    next_s = now_s + EVERY_S if line[:1].isdigit() else next_s

    def send(connection, waiting):
        with contextlib.suppress(OSError):
            while True:
                due_s, data = waiting.get()
                time.sleep(max(due_s - time.monotonic(), 0.0))
                connection.sendall(data)

    return serve


def frozen(connection):
    connection.sendall(b"t_s,x_mm,y_mm,z_mm\n")
    for k in range(100_000):
        connection.sendall(b"%.3f,466.300,-109.200,1056.100\n" % (0.02 * k))
        time.sleep(0.02)


def test_a_tracker_that_is_always_late_and_speaks_seldom_is_waited_for(record, at_home, tmp_path):
    with server(delayed(at_home)) as tracker:
        outcome = record(tracker)
    assert outcome.code == 0, outcome.err
    data = from_table(read_table(tmp_path / "data.csv"), 6)
    real = RealRobot("ur5_cell", SEED)
    visits = Visits(data.q_rad, np.zeros(len(data)), data.approach, real.gravity_torques(data.q_rad))
    truth = true_poses(real, visits, list(draw_causes(real, HIDDEN).values()))[:, :3, 3]
    assert 1e3 * np.linalg.norm(data.p_ME - truth, axis=1).max() < 0.15


def test_a_frozen_tracker_is_noticed_before_a_row_is_written(record, tmp_path):
    with server(frozen) as tracker:
        outcome = record(tracker)
    assert outcome.code == 1
    assert "frozen" in outcome.err
    assert not (tmp_path / "data.csv").exists()
    assert not progress_file(tmp_path / "data.csv").exists()


def test_a_program_that_runs_is_not_ended(record, at_home):
    at_home.command({"do": "set", "q_rad": HOME.tolist()})
    with socket.create_connection((at_home.address, 30003)) as port:
        port.sendall(b"def busy():\n  sleep(400)\nend\n")
        time.sleep(0.5)
        outcome = record("simulated")
        assert outcome.code == 1
        assert "a program is running" in outcome.err
        port.sendall(b"def nothing():\n  sleep(0.01)\nend\n")
        time.sleep(0.5)


def test_yes_does_not_mean_a_long_way_that_nobody_has_checked(record, at_home, tmp_path, monkeypatch):
    before = at_home.command({"do": "state"})["moves"]
    at_home.command({"do": "set", "q_rad": (HOME + 0.8).tolist()})
    outcome = record("simulated")
    assert outcome.code == 1
    assert "46 deg" in outcome.err
    assert "--first-move-deg" in outcome.err
    asked = []
    monkeypatch.setattr("typer.confirm", lambda question: bool(asked.append(question)))
    assert record("simulated", yes=None).code == 1
    assert "46 deg" in asked[0]
    assert at_home.command({"do": "state"})["moves"] == before
    assert not (tmp_path / "data.csv").exists()


def test_a_plan_for_another_robot_is_refused(record, poses):
    listed, path = poses
    path.write_text(to_csv(PoseList(listed.q_rad, listed.measure, listed.pose_id, robot_mark(load_robot("ur10")))))
    assert is_refused(record("simulated"), "planned for another robot", "ur10:", "ur5:")
