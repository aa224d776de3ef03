"""``truepath record`` as a user has it, against the virtual controller. The truth is Drake's."""

import json
import threading
import time

import numpy as np
import pytest
from command import is_refused
from truepath.measurements import from_table
from truepath.recording.row_file import progress_file
from truepath.tables import read_table
from truepath.virtual.hidden_causes import draw_causes, true_poses
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.visits import Visits
from virtual_robot import HIDDEN, HOME, SEED

BRISK = ("--settle-s", 0.1, "--measure-s", 0.1, "--speed-deg", 40, "--acceleration-deg", 120)


@pytest.fixture
def record(truepath, poses, tmp_path):
    """Function: the command on that list, writing data.csv."""

    def record(controller, *more):
        places = ("--robot-host", controller.address, "--tracker", "simulated", "-o", tmp_path / "data.csv")
        return truepath("record", poses[1], *places, *BRISK, *more)

    return record


def seen_by_drake(data):
    real = RealRobot("ur5_cell", SEED)
    visits = Visits(data.q_rad, np.zeros(len(data)), data.approach, real.gravity_torques(data.q_rad))
    return true_poses(real, visits, list(draw_causes(real, HIDDEN).values()))[:, :3, 3]


def moves(controller):
    return controller.command({"do": "state"})["moves"]


def test_what_is_recorded_is_where_the_robot_was_and_how_it_came_there(record, at_home, poses, tmp_path):
    before = moves(at_home)
    outcome = record(at_home, "--yes", "--robot", "ur5_cell")
    assert outcome.code == 0, outcome.err
    listed, _ = poses
    table = read_table(tmp_path / "data.csv")
    data = from_table(table, 6)
    assert table.text("visit") == ["1", "3", "4", "5"]
    assert data.pose_id.tolist() == [0, 1, 2, 3]
    assert np.allclose(data.q_rad, listed.q_rad[[0, 2, 3, 4]], atol=1e-9)
    sides = np.sign(np.diff(listed.q_rad, axis=0))
    assert data.approach.tolist() == [
        *(-sides[:1]).tolist(),
        *sides[1:].tolist(),
    ]  # the first from the side of the next
    assert 1e3 * np.abs(data.p_ME - seen_by_drake(data)).max() < 6 * 0.02 / np.sqrt(table.numbers(["readings"]).min())
    assert (data.payload_kg < 0.01).all()  # the controller carries what the model of the cell carries
    assert (np.diff(data.time_s) > 0).all()
    actual = table.numbers([f"q{i + 1}_actual_rad" for i in range(6)])
    assert np.abs(actual - data.q_rad).max() < 1e-4
    temperatures = table.numbers([f"temperature{i + 1}_c" for i in range(6)])
    assert np.allclose(temperatures.mean(axis=1), data.temperature_c, atol=0.01)
    assert 0.01 < table.numbers(["spread_mm"]).mean() < 0.06  # 0.02 mm in each of three directions
    assert moves(at_home) > before

    moved = moves(at_home)
    again = record(at_home, "--yes", "--resume", "--robot", "ur5_cell")
    assert again.code == 0
    assert "nothing left to measure" in again.out
    assert moves(at_home) == moved
    assert is_refused(record(at_home, "--yes"), "--resume")


def test_an_answer_other_than_yes_moves_nothing(record, at_home, monkeypatch):
    before = moves(at_home)
    at_home.command({"do": "set", "q_rad": (HOME + 0.3).tolist()})
    monkeypatch.setattr("typer.confirm", lambda question: False)
    outcome = record(at_home)
    assert outcome.code == 1
    assert "nobody has looked" in outcome.out
    assert "nothing was moved" in outcome.out
    assert moves(at_home) == before


@pytest.mark.parametrize(
    ("order", "reason"),
    [
        ({"do": "fault", "name": "protective_stop"}, "protective stop"),
        ({"do": "set", "remote_control": False}, "local control"),
        ({"do": "set", "payload_kg": 0.0}, "payload"),
    ],
)
def test_a_robot_that_is_not_ready_is_not_moved(record, at_home, tmp_path, order, reason):
    before = moves(at_home)
    at_home.command(order)
    outcome = record(at_home, "--yes", "--robot", "ur5_cell")
    assert outcome.code == 1
    assert reason in outcome.err
    assert "Traceback" not in outcome.err
    assert moves(at_home) == before
    assert not (tmp_path / "data.csv").exists()


def test_a_pose_beyond_the_limits_is_refused_before_anybody_is_asked(truepath, tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,0,0,0,0\n0,0,0,0,0,400\n")
    places = ("--robot-host", "127.0.2.95", "--tracker", "simulated", "-o", tmp_path / "data.csv")
    assert is_refused(truepath("record", path, *places), "line 3", "q6", "400.00 deg", "-360")


@pytest.mark.parametrize(
    ("option", "value"), [("--speed-deg", 0), ("--speed-deg", "nan"), ("--speed-deg", 1000), ("--settle-s", -1)]
)
def test_no_speed_and_no_time_are_refused(truepath, poses, tmp_path, option, value):
    places = ("--robot-host", "127.0.2.95", "--tracker", "simulated", "-o", tmp_path / "data.csv")
    assert is_refused(truepath("record", poses[1], *places, option, value), "more than 0")


def stop_after_a_row(controller, path):
    end = time.monotonic() + 20.0
    while not (path.exists() and path.read_bytes().count(b"\n") > 1) and time.monotonic() < end:
        time.sleep(0.01)
    controller.command({"do": "fault", "name": "protective_stop"})


def test_the_file_beside_the_data_says_which_list_it_is_of(record, at_home, poses, tmp_path):
    stop = threading.Thread(target=stop_after_a_row, args=(at_home, tmp_path / "data.csv"))
    stop.start()
    outcome = record(at_home, "--yes", "--robot", "ur5_cell")
    stop.join()
    assert outcome.code == 1
    assert "--resume goes on" in outcome.err
    side = json.loads(progress_file(tmp_path / "data.csv").read_text())
    assert side["schema"] == "truepath.recording/1"
    at_home.command({"do": "recover"})
    poses[1].write_text(poses[1].read_text().replace("\n1,1,", "\n9,1,"))
    assert is_refused(record(at_home, "--yes", "--resume", "--robot", "ur5_cell"), "another list")
