"""Faults on demand, as ur_rtde and a tracker's listener live through them, and the way back."""

import socket
import time

import numpy as np
import pytest
from drawn_robot import SPEED_UP, until
from rtde_by_hand import Rtde
from truepath.errors import InputError
from truepath.virtual.controller.options import ControllerOptions
from truepath.virtual.controller.service import Service
from ur_client import controller

FAR = [1.5, -1.2, 1.1, -1.4, -1.3, 0.5]


@pytest.fixture
def dashboard(quick):
    """Function: asks the dashboard a question."""

    def ask(question):
        with socket.create_connection((quick.address, 29999), 5) as connection, connection.makefile() as lines:
            assert "Dashboard" in lines.readline()
            connection.sendall(question.encode() + b"\n")
            return lines.readline().strip()

    return ask


def is_between(q, start, end):
    share = (np.array(q) - start)[0] / (np.array(end) - start)[0]
    return 0.01 < share < 0.99 and np.allclose(q, start + share * (np.array(end) - start), atol=1e-9)


def test_a_protective_stop_on_the_way_ends_move_and_script_and_is_unlocked_after_five_seconds(
    client, home, fault, state, dashboard
):
    fault("protective_stop", 0.5)
    assert client("control", "moveJ", FAR, 0.1, 1.4) is False
    told = state()
    assert (told["safety"], told["runtime"], told["program"]) == ("protective_stop", "stopped", None)
    assert dashboard("safetystatus") == "Safetystatus: PROTECTIVE_STOP"
    assert client.calls([["newer", state()["time_s"]], ["receive", "isProtectiveStopped"]]) == [True]
    assert "5s" in dashboard("unlock protective stop")
    until(lambda: np.allclose(state()["speed_rad_s"], 0))
    stopped = state()["commanded_q_rad"]
    assert is_between(stopped, home, FAR)
    assert client("control", "moveJ", FAR, 0.5, 1.4) is False
    assert state()["commanded_q_rad"] == stopped
    until(lambda: state()["time_s"] > told["time_s"] + 5.1)
    assert dashboard("unlock protective stop") == "Protective stop releasing"
    client.calls([["newer", state()["time_s"]], ["upload"]])
    assert client("control", "moveJ", FAR, 1.0, 1.4)
    assert np.allclose(state()["commanded_q_rad"], FAR)


def test_an_emergency_stop_cuts_the_power_until_a_person_has_gone_through_all_steps(
    quick, client, home, fault, state, dashboard
):
    fault("emergency_stop", 0.3)
    assert client("control", "moveJ", FAR, 0.1, 1.4) is False
    assert (state()["safety"], state()["robot_mode"]) == ("emergency_stop", 3)
    assert dashboard("robotmode") == "Robotmode: POWER_OFF"
    assert client.calls([["newer", state()["time_s"]], ["receive", "isEmergencyStopped"]]) == [True]
    assert "cannot" in dashboard("power on")
    quick.command({"do": "recover"})
    assert dashboard("power off") == "Powering off"
    assert "cannot" in dashboard("brake release")
    assert [dashboard("power on"), dashboard("brake release")] == ["Powering on", "Brake releasing"]
    client.calls([["newer", state()["time_s"]], ["upload"]])
    assert client("control", "moveJ", FAR, 1.0, 1.4)


def test_late_packets_come_in_bursts_but_none_is_lost(quick, fault):
    with Rtde(quick.address) as reader:
        reader.start(["timestamp"], 125)
        fault("late_packets", for_s=1.0)
        came, stamps = zip(*((time.monotonic(), reader.sample()["timestamp"]) for _ in range(200)), strict=True)
    assert np.allclose(np.diff(stamps), SPEED_UP / 125, atol=1e-9)
    late = (np.array(came) - came[0]) - (np.array(stamps) - stamps[0]) / SPEED_UP
    assert np.ptp(late) > 0.04


def test_missing_packets_leave_gaps_of_whole_periods(quick, fault):
    with Rtde(quick.address) as reader:
        reader.start(["timestamp"], 125)
        fault("missing_packets", for_s=1.0)
        time.sleep(0.05)
        stamps = np.array([reader.sample()["timestamp"] for _ in range(60)])
    periods = np.diff(stamps) / (SPEED_UP / 125)
    assert np.allclose(periods, periods.round(), atol=1e-6)
    assert periods.max() >= 2


def test_a_broken_beam_is_said_once_and_readings_follow_when_it_is_back(quick, fault):
    with socket.create_connection((quick.address, quick.tracker_port), 5) as stream, stream.makefile() as lines:
        assert lines.readline() == "t_s,x_mm,y_mm,z_mm\n"
        seen = [lines.readline()]
        fault("beam_break", for_s=0.3)
        seen += [lines.readline() for _ in range(40)]
    assert seen.count("beam_break\n") == 1
    at = seen.index("beam_break\n")
    before, after = (float(seen[k].split(",")[0]) for k in (at - 1, at + 1))
    assert after - before >= 0.3 * SPEED_UP


def test_the_order_to_recover_ends_every_fault(quick, fault, state):
    for name in ("protective_stop", "emergency_stop", "beam_break"):
        fault(name)
        time.sleep(0.02)
    quick.command({"do": "recover"})
    assert (state()["safety"], state()["robot_mode"]) == ("normal", 7)


@pytest.mark.parametrize(
    "order",
    [
        {"do": "fault", "name": "flood"},
        {"do": "fault", "name": "restart", "after_s": -1},
        {"do": "fault", "name": "restart", "for_s": "long"},
        {"do": "dance"},
        {"do": "set", "colour": "red"},
        {"do": "set", "q_rad": [0, 0, 0]},
        {"do": "set", "q_rad": [99, 0, 0, 0, 0, 0]},
        {"do": "set", "payload_kg": -1},
        {"do": "set", "tcp_offset": "long"},
        {},
    ],
)
def test_an_order_that_does_not_exist_is_refused(quick, order, state):
    before = state()
    with pytest.raises(InputError):
        quick.command(order)
    assert state()["tcp_offset"] == before["tcp_offset"]


@pytest.mark.parametrize(
    "options",
    [
        {"robot": "ur99"},
        {"address": "192.168.0.17"},
        {"speed_up": 0.0},
        {"payload_kg": -1.0},
        {"tcp_offset": [0, 0, 0]},
        {"hide": ["rust"]},
        {"noise_mm": -1},
        {"q_start_rad": [9, 0, 0, 0, 0, 0]},
        {"tracker_at_m": [1, 2]},
    ],
)
def test_what_a_controller_cannot_be_is_refused(options):
    with pytest.raises(InputError):
        Service(ControllerOptions(**options))


def test_a_controller_that_cannot_be_says_so_from_its_process():
    with pytest.raises(InputError, match="no cause 'rust'"):
        controller(hide=["rust"])
