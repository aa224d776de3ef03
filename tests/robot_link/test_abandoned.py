"""A robot in a move whose recorder and client are killed together: nobody is left but the controller itself."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

FAR_RAD, SPEED_RAD_S = 1.5, 0.01  # 7.5 s on the wall, where the controller lives twenty times faster


def speed(controller):
    return np.abs(controller.command({"do": "state"})["speed_rad_s"]).max()


def within(seconds, condition):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def test_the_watchdog_of_the_controller_stops_the_move(controller, link):
    goal = link.state().q_target_rad + np.array([FAR_RAD, 0, 0, 0, 0, 0])
    moves = (
        f"from truepath.robot_link import RobotLink\nlink = RobotLink({controller.address!r})\n"
        f"link.move_joints({goal.tolist()}, {SPEED_RAD_S}, 1.0)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", moves])
    assert within(20.0, lambda: speed(controller) > 0.0)
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split()
    assert len(children) == 2
    time.sleep(1.5)  # longer than the watchdog waits
    assert speed(controller) > 0.0
    for pid in (*children, parent.pid):
        os.kill(int(pid), signal.SIGKILL)
    parent.wait()
    assert within(2.0, lambda: controller.command({"do": "state"})["program"] is None)
    assert within(1.0, lambda: speed(controller) == 0.0)
    state = controller.command({"do": "state"})
    assert abs(state["commanded_q_rad"][0] - goal[0]) > 0.1
