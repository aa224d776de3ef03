"""Whether a robot may be moved from here at all, before anything tries."""

from __future__ import annotations

from truepath.robot_link.fault import RobotFault
from truepath.robot_link.link import RobotLink
from truepath.robot_link.state import ABLE_TO_MOVE, RUNNING_MODE, RobotState

MODES = {
    -1: "no controller",
    0: "disconnected",
    1: "confirm safety",
    2: "booting",
    3: "power off",
    4: "power on",
    5: "idle, the brakes are not released",
    6: "moved by hand",
    7: "running",
    8: "updating firmware",
}


def require_ready(link: RobotLink) -> RobotState:
    """The state of a robot that is able to move and lets itself be moved from here.

    Raises:
        RobotFault: it is not: safety, robot mode, or local control, where the dashboard tells (CB3 does not know it).
    """
    state = link.state()
    if state.safety not in ABLE_TO_MOVE:
        raise RobotFault(f"the robot cannot move: safety status {state.safety.replace('_', ' ')}")
    if state.robot_mode != RUNNING_MODE:
        raise RobotFault(f"the robot cannot move: robot mode {MODES.get(state.robot_mode, state.robot_mode)}")
    if is_in_local_control(link):
        raise RobotFault("the robot is in local control: switch to remote control on the teach pendant")
    return state


def is_in_local_control(link: RobotLink) -> bool:
    """Whether the dashboard says that only the pendant may move the robot; a silent one says nothing."""
    try:
        return link.dashboard("is in remote control").strip().lower() == "false"
    except RobotFault:
        return False
