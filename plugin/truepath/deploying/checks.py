"""What must be so before a program may move a robot; each thing that is not is a plain sentence."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from truepath import lie
from truepath.deploying.load import Load
from truepath.deploying.rehearsal import Rehearsal
from truepath.lie import Array
from truepath.robot import NominalRobot
from truepath.robot_link import RobotFault, RobotLink, RobotState
from truepath.robot_link.readiness import MODES
from truepath.robot_link.state import RUNNING_MODE
from truepath.virtual.controller.script_values import matrix

TCP_TOLERANCE_M, TCP_TOLERANCE_RAD = 2e-4, 2e-3
REMOTE = {"true": True, "false": False}


def robot_obstacles(link: RobotLink) -> tuple[RobotState, list[str], list[str]]:
    """Whether a robot can be given a program: its state, what is in the way, and what cannot be told.

    Raises:
        RobotFault: it does not answer.
    """
    state = link.state()
    found, unknown = [], []
    if state.safety != "normal":
        found.append(f"safety status is {state.safety.replace('_', ' ')}, not normal")
    if state.robot_mode != RUNNING_MODE:
        found.append(f"robot mode is {MODES.get(state.robot_mode, state.robot_mode)}, not running")
    if state.program_running:
        found.append("a program is running on the robot")
    if (np.abs(state.speed_rad_s) > 0.01).any():
        found.append("the robot is moving")
    remote = _is_in_remote_control(link)
    if remote is False:
        found.append("the robot is in local control: switch to remote control on the teach pendant")
    elif remote is None:
        unknown.append("the controller does not say whether it is in remote control")
    return state, found, unknown


def _is_in_remote_control(link: RobotLink) -> bool | None:
    """None from a controller that does not know the question, as CB3 does not."""
    try:
        return REMOTE.get(link.dashboard("is in remote control").strip().lower())
    except RobotFault:
        return None


def payload_obstacles(
    calibrated: Load | None, state: RobotState, rehearsal: Rehearsal
) -> tuple[list[str], list[str], list[str]]:
    """What is wrong with the payload on the controller, in the program, and what cannot be told.

    Args:
        calibrated: what the calibration was made with; None if it cannot be told from the arm.
    """
    stated = [
        Load(each.mass_kg, None if each.centre_m is None else np.array(each.centre_m)) for each in rehearsal.payloads
    ]
    on_robot = None if state.payload_kg is None else Load(state.payload_kg, state.payload_cog_m)
    unknown = [] if on_robot else ["the controller does not tell its payload"]
    wanted, whose = calibrated, "the calibration is for"
    if wanted is None:
        wanted, whose = (stated[0] if stated else None), "the program states"
        unknown.append("the payload cannot be compared with the calibration: its bare arm is not known")
    if wanted is None:
        return [], [], unknown
    robot = [f"the controller is set to a payload of {on_robot}, {whose} {wanted}"]
    program = [
        f"line {each.line} sets a payload of {load}, {whose} {wanted}"
        for each, load in zip(rehearsal.payloads, stated, strict=True)
        if not load.is_like(wanted)
    ]
    return robot if on_robot and not on_robot.is_like(wanted) else [], program, unknown


def tcp_obstacles(tcp: Array, corrected_for: Array) -> list[str]:
    """Whether the tool on the controller is the one that the program was corrected for; X_0T as ``(6,)`` each."""
    off = lie.pose_error(matrix(tcp), matrix(corrected_for))
    angle, distance = np.linalg.norm(off[:3]), np.linalg.norm(off[3:])
    if distance <= TCP_TOLERANCE_M and angle <= TCP_TOLERANCE_RAD:
        return []
    return [
        f"the TCP of the controller is {_shown(tcp)}, the program was corrected for {_shown(corrected_for)}: "
        f"{1e3 * distance:.1f} mm and {np.degrees(angle):.1f} deg apart"
    ]


def start_obstacles(
    robot: NominalRobot, q_now_rad: Array, q_start_rad: Array, within_rad: float, line: int | None
) -> list[str]:
    """Whether the robot stands in the posture, and not far from where, the program starts; joints ``(6,)``."""
    away = np.degrees(np.abs(q_now_rad - q_start_rad))
    if (away <= np.degrees(within_rad)).all():
        return []
    k = int(np.argmax(away))
    where = "stated" if line is None else f"of line {line}"
    return [
        f"joint {k + 1} ({robot.joint_names[k]}) is {away[k]:.0f} deg from the start {where}, more than "
        f"{np.degrees(within_rad):.0f}: drive the robot there first, or state --start-within-deg"
    ]


def _shown(pose: Iterable[float]) -> str:
    numbers = [*pose]
    position = ", ".join(f"{1e3 * x:.1f}" for x in numbers[:3])
    return f"({position}) mm, ({', '.join(f'{x:.3f}' for x in numbers[3:])}) rad"
