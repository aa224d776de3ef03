"""Deployment: all checks of a program, a calibration and a robot, then the run. Nothing moves before the run."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truepath.calibration import Calibration
from truepath.controller import Controller, controller_of, vectors_from_poses
from truepath.deploying.checks import payload_obstacles, robot_obstacles, start_obstacles, tcp_obstacles
from truepath.deploying.follow import Followed, Watched, send_and_follow
from truepath.deploying.load import calibrated_load
from truepath.deploying.outcome import Outcome, outcome_of
from truepath.deploying.passages import Passages
from truepath.deploying.rehearsal import Rehearsal, rehearse
from truepath.deploying.run_file import RunFile
from truepath.deploying.sent_program import SentProgram, read_program, require_correction, robot_remarks
from truepath.errors import InputError
from truepath.lie import Array
from truepath.robot_link import RobotFault, RobotLink, RobotState
from truepath.virtual.controller.script_instructions import ScriptError

LEAST_STALL_S, TIMES_THE_WAIT = 20.0, 2.0
QUIET_S = 5.0
SAME_RAD = 1e-3
NO_TOOL = (0.0,) * 6


@dataclass(frozen=True)
class DeployOptions:
    """What a user can choose.

    Attributes:
        uncorrected: a program without the stamp of this calibration is allowed.
        controller_kinematics: see ``controller.controller_of``.
        tool: TCP that the correction was made for where the program sets none, ``(6,)`` in m and rad; None: no tool.
        start_rad: joints from which the program is meant to start; None: at its first target.
        start_within_rad: how far any joint may be from there.
        timeout_s: for how long the robot may be silent.
    """

    uncorrected: bool = False
    controller_kinematics: str = "nominal"
    tool: tuple[float, ...] | None = None
    start_rad: tuple[float, ...] | None = None
    start_within_rad: float = math.radians(30.0)
    timeout_s: float = 2.0


@dataclass(frozen=True, eq=False)
class Prepared:
    """A program that may be run.

    Attributes:
        program, rehearsal: what will be run.
        calibration, controller: of the robot.
        state: of the robot when it was checked.
        remarks: what a person should know.
    """

    program: SentProgram
    rehearsal: Rehearsal
    calibration: Calibration
    controller: Controller
    state: RobotState
    remarks: tuple[str, ...]


class NotReady(RobotFault):
    """The robot cannot be given the program.

    Attributes:
        obstacles: all reasons, a plain sentence each.
    """

    def __init__(self, obstacles: Sequence[str]) -> None:
        self.obstacles = tuple(obstacles)
        super().__init__("; ".join(obstacles))


def prepare(path: str | Path, calibration: Calibration, link: RobotLink, options: DeployOptions) -> Prepared:
    """Looks at everything that must be so. The robot does not move.

    Args:
        path: of the program.
        calibration: with the payload that the correction was made for.
        link: to the robot.
        options: see there.

    Raises:
        InputError: the program is not one for this robot and calibration.
        NotReady: the robot is not ready for it.
        RobotFault: the robot does not answer.
    """
    program = read_program(path)
    remarks = robot_remarks(program, calibration)
    try:
        require_correction(program, calibration)
    except InputError as error:
        if not options.uncorrected:
            raise
        remarks.append(f"{error.problem}: the tool may go elsewhere than the program means")
    robot = calibration.model.robot
    controller = controller_of(robot, options.controller_kinematics)
    state, obstacles, unknown = robot_obstacles(link)
    if obstacles:
        raise NotReady(obstacles)
    start = state.q_rad if options.start_rad is None else np.array(options.start_rad)
    tool = options.tool or NO_TOOL
    try:
        rehearsal = rehearse(program.text, controller, start, tool)
        from_here = rehearsal if options.start_rad is None else rehearse(program.text, controller, state.q_rad, tool)
    except ScriptError as error:
        raise InputError(error.reason, file=program.file, line=error.line) from None
    _require_posture(rehearsal, program, options)
    _require_reach(rehearsal, calibration, program)
    payload_on_robot, payload_in_program, untold = payload_obstacles(
        calibrated_load(calibration, controller), state, rehearsal
    )
    if payload_in_program:
        raise InputError("; ".join(payload_in_program), file=program.file)
    obstacles += payload_on_robot
    if options.start_rad is not None:
        obstacles += start_obstacles(robot, state.q_rad, start, options.start_within_rad, None)
        if (
            rehearsal.q_rad.shape != from_here.q_rad.shape
            or np.abs(rehearsal.q_rad - from_here.q_rad).max(initial=0.0) > SAME_RAD
        ):
            obstacles.append("from where the robot stands it would take other postures than from the start stated")
    if len(rehearsal):
        goal, line = rehearsal.q_rad[0], int(rehearsal.line[0])
        obstacles += start_obstacles(robot, state.q_rad, goal, options.start_within_rad, line)
    if rehearsal.depends_on_tool and not obstacles:  # last, because to ask takes a program on the controller
        obstacles += tcp_obstacles(_tcp_of(link), vectors_from_poses(rehearsal.X_0T[0]))
    if obstacles:
        raise NotReady(obstacles)
    if rehearsal.open_end is not None:
        untold.append(f"only the first {len(rehearsal)} targets are known: {rehearsal.open_end}")
    return Prepared(program, rehearsal, calibration, controller, state, (*remarks, *unknown, *untold))


def run(prepared: Prepared, link: RobotLink, record: Path | None, watched: Watched) -> Outcome:
    """Sends the program and follows it to its end.

    Raises:
        InputError: the record cannot be written.
        RobotFault: the robot was no longer ready, or could not be given the program; nothing has moved.
    """
    rehearsal = prepared.rehearsal
    passages = Passages(rehearsal.q_rad, rehearsal.blend_m)
    with RunFile(record) as rows:
        state, obstacles, _ = robot_obstacles(link)  # somebody may have come near while the question was open
        if np.abs(state.q_rad - prepared.state.q_rad).max() > 1e-3:
            obstacles.append("the robot was moved since it was checked")
        if obstacles:
            raise NotReady(obstacles)
        stall_s = max(LEAST_STALL_S, TIMES_THE_WAIT * rehearsal.longest_wait_s)
        followed: Followed = send_and_follow(link, prepared.program.sent, passages, rows, stall_s, watched)
    return outcome_of(rehearsal, followed, passages, prepared.calibration, prepared.controller)


def _tcp_of(link: RobotLink) -> Array:
    """``(6,)`` X_0T on the controller. Only its control script tells, which has ended when this returns."""
    with RobotLink(link.host, link.timeout_s) as asking:
        tcp = asking.tcp_offset()
    end = time.monotonic() + QUIET_S
    while link.state().program_running:
        if time.monotonic() > end:
            raise RobotFault("the program that was asked for the TCP does not end")
        time.sleep(0.02)
    return tcp


def _require_posture(rehearsal: Rehearsal, program: SentProgram, options: DeployOptions) -> None:
    """A pose says nothing of the posture in which the correction took the arm to be."""
    if len(rehearsal) and rehearsal.is_pose[0] and options.start_rad is None:
        raise InputError(
            "the program starts with a pose, so that its posture is a matter of where the robot stands",
            file=program.file,
            line=int(rehearsal.line[0]),
            expected="the joints from which it was corrected to start: --start-deg",
        )


def _require_reach(rehearsal: Rehearsal, calibration: Calibration, program: SentProgram) -> None:
    robot = calibration.model.robot
    beyond = (rehearsal.q_rad < robot.lower_rad - 1e-6) | (rehearsal.q_rad > robot.upper_rad + 1e-6)
    if beyond.any():
        k, joint = np.argwhere(beyond)[0]
        raise InputError(
            "a target beyond a joint limit",
            file=program.file,
            line=int(rehearsal.line[k]),
            column=f"q{joint + 1} ({robot.joint_names[joint]})",
            found=f"{rehearsal.q_rad[k, joint]:.6f} rad",
        )
