"""What must be so before a program may move a robot; each thing that is not is a plain sentence."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import numpy as np

from truepath import lie
from truepath.controller import Controller, vectors_from_poses
from truepath.deploying.load import Load
from truepath.lie import Array
from truepath.robot import NominalRobot
from truepath.robot_link import RobotFault, RobotLink, RobotState
from truepath.robot_link.readiness import MODES, is_in_remote_control
from truepath.robot_link.state import RUNNING_MODE
from truepath.virtual.controller.script_instructions import SetPayload
from truepath.virtual.controller.script_values import matrix

TCP_TOLERANCE_M, TCP_TOLERANCE_RAD = 2e-4, 2e-3
# A controller knows its arm as measured in the factory: some mm from the published one. Two types are 50 mm apart.
ANOTHER_ROBOT_M, ANOTHER_ROBOT_RAD = 0.02, 0.1
MOVED_RAD = 1e-3


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
    if not (np.abs(state.speed_rad_s) <= 0.01).all():  # a NaN is no robot that stands
        found.append("the robot is moving")
    if not np.isfinite([state.q_rad, state.tcp_pose]).all():
        found.append("the controller does not tell its joints and its tool in numbers")
    remote = is_in_remote_control(link)
    if remote is False:
        found.append("the robot is in local control: switch to remote control on the teach pendant")
    elif remote is None:
        unknown.append("the controller does not say whether it is in remote control")
    return state, found, unknown


def moved_obstacles(state: RobotState, q_rad: Array) -> list[str]:
    """Whether the robot stands where it stood, ``(6,)``."""
    if (np.abs(state.q_rad - q_rad) <= MOVED_RAD).all():
        return []
    return ["the robot was moved since it was checked"]


def another_robot_obstacles(controller: Controller, name: str, state: RobotState, tcp: Array, told: str) -> list[str]:
    """Whether the connected robot is built as the calibrated one: where its controller has the tool at its joints.

    Args:
        controller: of the calibrated robot.
        name: of that robot.
        state: of the connected one.
        tcp: X_0T on its controller, ``(6,)``.
        told: what its dashboard says that it is, or nothing.
    """
    wanted = controller.tool_poses(state.q_rad[None], matrix(tcp))[0]
    off = lie.pose_error(matrix(state.tcp_pose), wanted)
    angle, distance = np.linalg.norm(off[:3]), np.linalg.norm(off[3:])
    if distance <= ANOTHER_ROBOT_M and angle <= ANOTHER_ROBOT_RAD:
        return []
    itself = f" It says that it is a {told}." if told else ""
    return [
        f"this is not a {name}: at its joints the controller has the tool at {_shown(state.tcp_pose)}, a {name} at "
        f"{_shown(vectors_from_poses(wanted[None])[0])}: {1e3 * distance:.0f} mm and {np.degrees(angle):.1f} deg "
        f"apart.{itself}"
    ]


def model_told(link: RobotLink) -> str:
    """What the dashboard calls the robot; nothing if it does not know the question."""
    try:
        answer = link.dashboard("get robot model").strip()
    except RobotFault:
        return ""
    return answer if re.fullmatch(r"[A-Za-z0-9 ]{1,20}", answer) else ""


def payload_obstacles(
    calibrated: Load | None, state: RobotState, payloads: Sequence[SetPayload]
) -> tuple[list[str], list[str], list[str]]:
    """What is wrong with the payload on the controller, in the program, and remarks.

    Args:
        calibrated: what the calibration was made with; None if it cannot be told from the arm.
        payloads: that the program sets.
    """
    stated = [Load(each.mass_kg, None if each.centre_m is None else np.array(each.centre_m)) for each in payloads]
    on_robot = None if state.payload_kg is None else Load(state.payload_kg, state.payload_cog_m)
    remarks = [] if on_robot else ["the controller does not tell its payload"]
    wanted, whose = calibrated, "the calibration is for"
    if wanted is None:
        wanted, whose = (stated[0] if stated else None), "the program states"
        remarks.append("the payload cannot be compared with the calibration: its bare arm is not known")
    if wanted is None:
        return [], [], remarks
    robot, program = [], []
    if on_robot:
        said = f"the controller is set to a payload of {on_robot}, {whose} {wanted}"
        if not on_robot.is_like(wanted):
            robot.append(said)
        elif on_robot.is_a_little_other(wanted):
            remarks.append(said)
    for each, load in zip(payloads, stated, strict=True):
        said = f"line {each.line} sets a payload of {load}, {whose} {wanted}"
        if not load.is_like(wanted):
            program.append(said)
        elif load.is_a_little_other(wanted):
            remarks.append(said)
    return robot, program, remarks


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
