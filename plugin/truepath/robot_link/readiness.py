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
REMOTE = {"true": True, "false": False}
NOT_KNOWN = "could not understand"


def require_ready(link: RobotLink) -> RobotState:
    """The state of a robot that is able to move and lets itself be moved from here.

    Raises:
        RobotFault: it is not: safety, robot mode, or local control, where the dashboard knows the question (CB3 does
            not); a dashboard that is silent.
    """
    state = link.state()
    if state.safety not in ABLE_TO_MOVE:
        raise RobotFault(f"the robot cannot move: safety status {state.safety.replace('_', ' ')}")
    if state.robot_mode != RUNNING_MODE:
        raise RobotFault(f"the robot cannot move: robot mode {MODES.get(state.robot_mode, state.robot_mode)}")
    if is_in_remote_control(link) is False:
        raise RobotFault("the robot is in local control: switch to remote control on the teach pendant")
    return state


def is_in_remote_control(link: RobotLink) -> bool | None:
    """Whether others than the pendant may move the robot; None if the dashboard says that it does not know the
    question, as that of CB3 and of old PolyScope does.

    Raises:
        RobotFault: it does not answer in time, or something else.
    """
    answer = link.dashboard("is in remote control").strip()
    if answer.lower() in REMOTE:
        return REMOTE[answer.lower()]
    if answer.lower().startswith(NOT_KNOWN):
        return None
    raise RobotFault(f"the dashboard does not say whether the robot is in remote control, but {answer[:80]!r}")
