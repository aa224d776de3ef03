"""``truepath record`` as a user has it, against the virtual controller. The truth is Drake's."""

import hashlib
import json
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
import truepath.recording.record
from command import is_refused
from truepath.measurements import from_table
from truepath.planning.pose_list import PoseList, to_csv
from truepath.recording.connected_robot import require_same_robot
from truepath.recording.readings import Reading
from truepath.recording.row_file import RowFile, progress_file
from truepath.recording.visit import Visit, cells, columns
from truepath.robot_link import RobotLink
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


@pytest.mark.parametrize("payload_kg", ["inf", 1000])
def test_no_payload_of_a_robot_is_refused(truepath, poses, tmp_path, payload_kg):
    places = ("--robot-host", "127.0.2.95", "--tracker", "simulated", "-o", tmp_path / "data.csv")
    assert is_refused(truepath("record", poses[1], *places, "--payload-kg", payload_kg), "no payload", "0 to 100 kg")


def test_another_robot_behind_the_address_is_not_moved(record, at_home, tmp_path):
    """The list does not say for which robot it was planned, and keeps the limits of both."""
    before = moves(at_home)
    outcome = record(at_home, "--yes", "--robot", "ur10", "--payload-kg", 0)
    assert outcome.code == 1
    assert "this is not a ur10" in outcome.err
    assert "says that it is a UR5" in outcome.err
    assert moves(at_home) == before
    assert not (tmp_path / "data.csv").exists()


def test_a_robot_that_nobody_has_published_is_told_to_be_unknown(at_home, ur5):
    """Where its controller has base and flange is not known, so that nothing can be compared."""
    X_BA = ur5.X_BA.copy()
    X_BA[3:, 0, 3] += 0.01
    with RobotLink(at_home.address) as link:
        remark = require_same_robot(link, replace(ur5, X_BA=X_BA))
    assert "nobody can tell whether this is a ur5" in remark
    assert "says that it is a UR5" in remark


def test_a_list_that_is_saved_anew_while_it_is_read_is_refused(record, at_home, poses, monkeypatch):
    read = truepath.recording.record.read_pose_list

    def read_and_save(path):
        listed = read(path)
        path.write_text(path.read_text().replace("\n1,1,", "\n9,1,"))
        return listed

    monkeypatch.setattr("truepath.recording.record.read_pose_list", read_and_save)
    assert is_refused(record(at_home, "--yes"), "changed while it was read")


def test_a_recording_whose_rows_do_not_fit_together_does_not_go_on(truepath, at_home, ur5, tmp_path):
    """The readings of one were taken before the tracker was moved."""
    q = HOME + np.random.default_rng(8).uniform(-0.3, 0.3, (8, 6))
    listed = PoseList(q, np.ones(8, bool), np.arange(8))
    (tmp_path / "list.csv").write_text(to_csv(listed))
    sha256 = hashlib.sha256((tmp_path / "list.csv").read_bytes()).hexdigest()
    p_ME = RealRobot("ur5_cell", SEED).reflector_poses(q)[:, :3, 3]
    p_ME[4] += 0.5
    with RowFile(tmp_path / "data.csv", listed, sha256, columns(6, False), resume=False) as rows:
        for k in range(7):
            reading = Reading(p_ME[k], None, 0.02, 99, 5.0)
            zero = np.zeros(6)
            rows.append(k, cells(Visit(k, k, q[k], q[k], zero, zero.astype(int), float(k), 0.0, reading)))
    before = moves(at_home)
    places = ("--robot-host", at_home.address, "--tracker", "simulated", "-o", tmp_path / "data.csv")
    outcome = truepath("record", tmp_path / "list.csv", *places, "--robot", "ur5_cell", "--yes", "--resume")
    assert outcome.code == 1
    assert "visit 5 lies more than 20 mm" in outcome.err
    assert moves(at_home) == before


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
