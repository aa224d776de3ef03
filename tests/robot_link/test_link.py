"""The link to a robot: the real client in its child processes, against the virtual controller and its faults.

What is true is asked of the controller itself, beside its protocols.
"""

import os
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from truepath.robot_link import RobotFault, RobotLink
from truepath.robot_link import link as link_module
from truepath.robot_link.link import duration_of_move
from truepath.robot_link.readiness import require_ready

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
FAR = HOME + np.array([1.5, 0.3, -0.3, 0.2, 0.1, 1.0])
BRISK = (0.5, 1.0)  # rad/s, rad/s^2: 3.5 s to FAR for the robot, a twentieth of that on the wall
SLOW = (0.05, 1.0)  # 1.5 s on the wall: time enough to be disturbed


def true(controller):
    return controller.command({"do": "state"})


def in_the_middle(controller, act):
    """Does something a moment after the robot has begun to move."""

    def wait_and_act():
        end = time.monotonic() + 10.0
        while not np.abs(true(controller)["speed_rad_s"]).max() > 0.02 and time.monotonic() < end:
            time.sleep(0.01)
        act()

    thread = threading.Thread(target=wait_and_act)
    thread.start()
    return thread


def stands(controller):
    """Whether it stands, or comes to rest within a second."""
    end = time.monotonic() + 1.0
    while np.abs(true(controller)["speed_rad_s"]).max() > 0.0 and time.monotonic() < end:
        time.sleep(0.02)
    return np.abs(true(controller)["speed_rad_s"]).max() == 0.0


def test_the_state_is_what_the_controller_knows(controller, link):
    state, truth = link.state(), true(controller)
    assert np.allclose(state.q_rad, truth["commanded_q_rad"], atol=1e-9)
    assert state.payload_kg == pytest.approx(truth["payload_kg"])
    assert (state.safety, state.robot_mode, state.able_to_move) == ("normal", 7, True)
    assert (state.temperatures_c > 15).all()
    assert state.tcp_offset is None


def test_reading_takes_no_control_and_moves_nothing(controller):
    before = true(controller)["moves"]
    with RobotLink(controller.address) as link:
        link.state()
        link.samples()
        assert link.dashboard("is in remote control") == "true"
        assert (true(controller)["program"], true(controller)["moves"]) == (None, before)


def test_samples_come_in_order_and_once(link):
    link.state()
    link.samples()
    time.sleep(0.4)
    times = [state.time_s for state in link.samples()]
    assert 30 < len(times) < 60
    assert (np.diff(times) > 0).all()


def test_a_move_returns_when_the_robot_is_there(controller, link):
    for goal in (FAR, HOME):
        link.move_joints(goal, *BRISK)
        assert np.abs(np.array(true(controller)["commanded_q_rad"]) - goal).max() < 1e-6
        assert stands(controller)
    assert np.allclose(link.tcp_offset(), true(controller)["tcp_offset"])
    assert link.state().tcp_offset is not None


def test_a_line_is_moved_along_and_the_joints_follow(controller, link):
    goal = link.state().tcp_pose + np.array([0.03, 0.02, -0.04, 0, 0, 0])
    link.move_line(goal, 0.1, 0.5)
    assert np.allclose(link.state().tcp_pose[:3], goal[:3], atol=2e-4)


def test_a_protective_stop_ends_a_move_with_its_name_and_the_robot_goes_on_when_it_is_freed(controller, link):
    stop = in_the_middle(controller, lambda: controller.command({"do": "fault", "name": "protective_stop"}))
    begin = time.monotonic()
    with pytest.raises(RobotFault, match="protective stop"):
        link.move_joints(FAR, *SLOW)
    stop.join()
    assert time.monotonic() - begin < 20.0  # the client itself would wait for 300 s
    with pytest.raises(RobotFault, match="protective stop"):
        link.move_joints(HOME, *BRISK)
    controller.command({"do": "recover"})
    link.move_joints(HOME, *BRISK)
    assert np.allclose(true(controller)["commanded_q_rad"], HOME, atol=1e-6)


@pytest.mark.parametrize("child", ["_control", "_reading"])
def test_a_child_that_dies_in_a_move_leaves_parent_and_robot_unharmed(controller, link, child):
    stop = in_the_middle(controller, lambda: os.kill(getattr(link, child).pid, signal.SIGKILL))
    try:
        link.move_joints(FAR, *SLOW)
        arrived = True  # the reading child was replaced in time
    except RobotFault:
        arrived = False
    stop.join()
    assert stands(controller)
    assert arrived == (np.abs(np.array(true(controller)["commanded_q_rad"]) - FAR).max() < 1e-6)
    assert not (arrived and child == "_control")


def test_a_controller_that_freezes_in_a_move_is_given_up_in_time(controller, link):
    """Longer than the 2.5 s after which the client crashes its own process."""
    thaw = threading.Timer(3.0, lambda: os.kill(controller.pid, signal.SIGCONT))

    def freeze():
        os.kill(controller.pid, signal.SIGSTOP)
        thaw.start()

    stop = in_the_middle(controller, freeze)
    begin = time.monotonic()
    with pytest.raises(RobotFault, match=r"no data|does not answer|lost|gone"):
        link.move_joints(FAR, *SLOW)
    assert time.monotonic() - begin < 30.0
    stop.join()
    thaw.join()
    assert link.state().able_to_move
    link.move_joints(HOME, *BRISK)


def test_a_controller_that_hangs_up_in_a_move_is_lost_and_found_again(controller, link):
    order = {"do": "fault", "name": "connection_lost", "for_s": 0.5}
    stop = in_the_middle(controller, lambda: controller.command(order))
    with pytest.raises(RobotFault):
        link.move_joints(FAR, *SLOW)
    stop.join()
    time.sleep(0.6)
    link.move_joints(HOME, *BRISK)
    assert np.allclose(true(controller)["commanded_q_rad"], HOME, atol=1e-6)


def test_when_the_parent_dies_the_robot_stops(controller, link):
    link.close()
    program = (
        "import sys; from truepath.robot_link import RobotLink\n"
        "with RobotLink(sys.argv[1]) as link: link.move_joints([float(a) for a in sys.argv[2:]], 0.05, 1.0)"
    )
    parent = subprocess.Popen([sys.executable, "-c", program, controller.address, *map(str, FAR)])
    in_the_middle(controller, parent.kill).join()
    parent.wait()
    time.sleep(0.3)
    assert stands(controller)
    assert np.abs(np.array(true(controller)["commanded_q_rad"]) - FAR).max() > 0.1


def test_stopping_works_without_control_too(controller, link):
    link.send_program(f"def walk():\n  movej({FAR.tolist()}, a=1, v=0.05)\nend\n")
    begin = time.monotonic()
    in_the_middle(controller, link.stop).join()
    assert time.monotonic() - begin < 5.0  # it has begun: nothing else is waited for
    time.sleep(0.2)
    assert stands(controller)


def test_nobody_there_is_told_at_once():
    begin = time.monotonic()
    with RobotLink("127.0.2.99") as link, pytest.raises(RobotFault, match=r"127\.0\.2\.99 cannot be read"):
        link.state()
    assert time.monotonic() - begin < 3.0


def test_who_accepts_and_never_answers_is_given_up(monkeypatch):
    """The constructor of the client holds its whole process meanwhile; it is killed."""
    monkeypatch.setattr(link_module, "START_S", 1.0)
    with socket.create_server(("127.0.2.98", 30004)), RobotLink("127.0.2.98", timeout_s=0.5) as link:
        begin = time.monotonic()
        with pytest.raises(RobotFault, match=r"127\.0\.2\.98"):
            link.state()
        assert time.monotonic() - begin < 3.0


def test_readiness_names_what_is_in_the_way(controller, link):
    assert require_ready(link).able_to_move
    controller.command({"do": "set", "remote_control": False})
    with pytest.raises(RobotFault, match="local control"):
        require_ready(link)
    controller.command({"do": "set", "remote_control": True})
    controller.command({"do": "fault", "name": "emergency_stop"})
    time.sleep(0.1)
    with pytest.raises(RobotFault, match="emergency stop"):
        require_ready(link)


@pytest.mark.parametrize(
    ("distance", "seconds"),
    [(0.0, 0.0), (1.0, 2.0), (4.0, 5.0), (0.25, 1.0)],
)
def test_the_duration_of_a_move_is_that_of_a_trapezoid(distance, seconds):
    """At 1 rad/s and 1 rad/s^2; by hand: up to 1 rad a triangle, beyond it a second for every rad."""
    assert duration_of_move(distance, 1.0, 1.0) == pytest.approx(seconds)
