"""Whether a robot may be taken for a recording: nobody else is using it."""

from __future__ import annotations

import re
import time

import numpy as np

from truepath.robot_link import RobotFault, RobotLink, RobotState
from truepath.robot_link.readiness import require_ready

MOVING_RAD_S = 0.01
PATIENCE_S = 3.0  # the program of a recorder that was killed a moment ago is still about to end
POLL_S = 0.05


def require_free_robot(link: RobotLink) -> RobotState:
    """The state of a robot that is able to move, stands still, and runs no program.

    Raises:
        RobotFault: it is not so.
    """
    state = require_ready(link)
    end_s = time.monotonic() + PATIENCE_S
    while why := _why_not_free(state):
        if time.monotonic() > end_s:
            raise RobotFault(why)
        time.sleep(POLL_S)
        state = link.state()
    return state


def serial_number(link: RobotLink) -> str | None:
    """Of the robot, as its dashboard has it; None where it does not tell (CB3 does not know the question)."""
    try:
        found = re.fullmatch(r"[0-9]{4,30}", link.dashboard("get serial number").strip())
    except RobotFault:
        return None
    return found[0] if found else None


def _why_not_free(state: RobotState) -> str:
    if state.program_running:
        return "a program is running on the robot: recording would end it, so end it first"
    if np.abs(state.speed_rad_s).max() > MOVING_RAD_S:
        return "the robot is moving"
    return ""
