"""Deployment: all checks of a program, a calibration and a robot, then the run. Nothing moves before the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truepath.calibration import Calibration
from truepath.controller import Controller, controller_of, vectors_from_poses
from truepath.deploying.checks import (
    another_robot_obstacles,
    model_told,
    moved_obstacles,
    payload_obstacles,
    robot_obstacles,
    start_obstacles,
    tcp_obstacles,
)
from truepath.deploying.follow import Followed, Watched, send_and_follow
from truepath.deploying.left_uncorrected import uncorrected_remarks
from truepath.deploying.load import Load, calibrated_load
from truepath.deploying.outcome import Outcome, outcome_of
from truepath.deploying.passages import Passages
from truepath.deploying.rehearsal import Rehearsal, rehearse
from truepath.deploying.rehearsed_way import rehearsed_way
from truepath.deploying.run_file import RunFile
from truepath.deploying.sent_program import SentProgram, read_program, require_correction, robot_remarks
from truepath.deploying.settings import Settings, settings_in
from truepath.deploying.stall import Stall, may_stand
from truepath.errors import InputError
from truepath.lie import Array
from truepath.robot_link import RobotFault, RobotLink, RobotState
from truepath.robot_link.tool import tcp_on_controller
from truepath.virtual.controller.script_instructions import ScriptError

SAME_RAD = 1e-3
NO_TOOL = (0.0,) * 6


@dataclass(frozen=True)
class DeployOptions:
    """What a user can choose.

    Attributes:
        uncorrected: a program without the stamp of this calibration is allowed.
        unrehearsed: a program is allowed of which nobody knows where it goes first.
        controller_kinematics: see ``controller.controller_of``.
        tool: TCP that the correction was made for where the program sets none, ``(6,)`` in m and rad; None: no tool.
        start_rad: joints from which the program is meant to start; None: at its first target.
        start_within_rad: how far any joint may be from there.
        stall_s: for how long it may stand while the program runs; None: as the program's own waits suggest.
        timeout_s: for how long the robot may be silent.
    """

    uncorrected: bool = False
    unrehearsed: bool = False
    controller_kinematics: str = "nominal"
    tool: tuple[float, ...] | None = None
    start_rad: tuple[float, ...] | None = None
    start_within_rad: float = math.radians(30.0)
    stall_s: float | None = None
    timeout_s: float = 2.0


@dataclass(frozen=True, eq=False)
class Prepared:
    """A program that may be run.

    Attributes:
        program, rehearsal: what will be run.
        calibration, controller: of the robot.
        load: what the robot must carry; None if it cannot be told.
        tool: X_0T that must be set on the controller, ``(6,)``; None if it does not matter.
        state: of the robot when it was checked.
        stall_s: so long it may stand while the program runs.
        may_wait: if it stands for longer, that is told only: nobody knows what the program waits for.
        remarks: what a person should know.
    """

    program: SentProgram
    rehearsal: Rehearsal
    calibration: Calibration
    controller: Controller
    load: Load | None
    tool: Array | None
    state: RobotState
    stall_s: float
    may_wait: bool
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
    robot = calibration.model.robot
    controller = controller_of(robot, options.controller_kinematics)
    remarks = robot_remarks(program, calibration)
    try:
        require_correction(program, calibration)
    except InputError as error:
        if not options.uncorrected:
            raise
        remarks.append(f"{error.problem}: the tool may go elsewhere than the program means")
    else:
        remarks += uncorrected_remarks(program, robot, controller, options.tool, options.start_rad)
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
    settings = Settings() if rehearsal.open_end is None else settings_in(program.text)
    _require_first_target(rehearsal, program, options)
    _require_posture(rehearsal, program, options)
    _require_reach(rehearsal, calibration, program)
    load = calibrated_load(calibration, controller)
    payloads = dict.fromkeys((*rehearsal.payloads, *settings.payloads))
    payload_on_robot, payload_in_program, untold = payload_obstacles(load, state, [*payloads])
    if payload_in_program:
        raise InputError("; ".join(payload_in_program), file=program.file)
    obstacles += payload_on_robot
    if options.start_rad is not None:
        obstacles += start_obstacles(robot, state.q_rad, start, options.start_within_rad, None)
        if (
            rehearsal.q_rad.shape != from_here.q_rad.shape
            or not np.abs(rehearsal.q_rad - from_here.q_rad).max(initial=0.0) <= SAME_RAD
        ):
            obstacles.append("from where the robot stands it would take other postures than from the start stated")
    if len(rehearsal):
        goal, line = rehearsal.q_rad[0], int(rehearsal.line[0])
        obstacles += start_obstacles(robot, state.q_rad, goal, options.start_within_rad, line)
    wanted_tool = _tool_of(rehearsal, settings, options)
    if not obstacles:  # last, because to ask takes a program on the controller
        tcp = tcp_on_controller(link)
        obstacles += another_robot_obstacles(controller, calibration.robot.name, state, tcp, model_told(link))
        if wanted_tool is not None and not obstacles:
            obstacles += tcp_obstacles(tcp, wanted_tool)
    if obstacles:
        raise NotReady(obstacles)
    untold += _open_end_remarks(rehearsal, settings)
    remarks += (*unknown, *untold)
    stall_s, may_wait = may_stand(rehearsal, options.stall_s)
    return Prepared(
        program, rehearsal, calibration, controller, load, wanted_tool, state, stall_s, may_wait, tuple(remarks)
    )


def run(
    prepared: Prepared, link: RobotLink, record: Path | None, watched: Watched, tell: Callable[[str], None]
) -> Outcome:
    """Sends the program and follows it to its end.

    Args:
        prepared: see there.
        link: to the robot.
        record: where to write down what is seen.
        watched: is told how it goes.
        tell: gets what a person should hear at once.

    Raises:
        InputError: the record cannot be written.
        RobotFault: the robot was no longer ready, or could not be given the program; nothing has moved.
    """
    rehearsal = prepared.rehearsal
    passages = Passages(rehearsal.q_rad, rehearsal.blend_m)
    way = rehearsed_way(rehearsal, prepared.controller, prepared.state.q_rad)
    _require_still_ready(prepared, link)
    with RunFile(record) as rows:  # not before: a run that does not begin must not cost an older record
        stall = Stall(prepared.stall_s, tell if prepared.may_wait else None)
        followed: Followed = send_and_follow(link, prepared.program.sent, passages, way, rows, stall, watched)
    return outcome_of(rehearsal, followed, passages, prepared.calibration, prepared.controller)


def _require_still_ready(prepared: Prepared, link: RobotLink) -> None:
    """Somebody may have come near, or changed the controller, while the question was open."""
    _require_same_state(prepared, link)
    if prepared.tool is not None:
        obstacles = tcp_obstacles(tcp_on_controller(link), prepared.tool)
        if obstacles:
            raise NotReady(obstacles)
        _require_same_state(prepared, link)


def _require_same_state(prepared: Prepared, link: RobotLink) -> None:
    state, obstacles, _ = robot_obstacles(link)
    obstacles += moved_obstacles(state, prepared.state.q_rad)
    obstacles += payload_obstacles(prepared.load, state, prepared.rehearsal.payloads)[0]
    if obstacles:
        raise NotReady(obstacles)


def _tool_of(rehearsal: Rehearsal, settings: Settings, options: DeployOptions) -> Array | None:
    """``(6,)`` X_0T that the correction was made for, as far as can be told; None if it does not matter."""
    if rehearsal.depends_on_tool:
        return vectors_from_poses(rehearsal.X_0T[0])
    if rehearsal.open_end is None:
        return None
    if settings.tools:
        return np.array(settings.tools[0].tool)
    return None if options.tool is None else np.array(options.tool)


def _open_end_remarks(rehearsal: Rehearsal, settings: Settings) -> list[str]:
    if rehearsal.open_end is None:
        return []
    first = "target is" if len(rehearsal) == 1 else f"{len(rehearsal)} targets are"
    known = f"only the first {first} known" if len(rehearsal) else "no target is known"
    remarks = [f"{known}: {rehearsal.open_end}"]
    if not len(rehearsal):
        remarks.append("nobody has looked at posture, joint limits and the way to the first target")
    if settings.unclear:
        lines = ", ".join(map(str, settings.unclear))
        remarks.append(f"payload or tool that the program computes cannot be looked at: line {lines}")
    return remarks


def _require_first_target(rehearsal: Rehearsal, program: SentProgram, options: DeployOptions) -> None:
    if rehearsal.open_end is None or len(rehearsal) or options.unrehearsed:
        return
    raise InputError(
        "nobody can tell where the program goes first, so that posture, joint limits and its way there cannot be "
        "looked at",
        file=program.file,
        expected="a program whose first move does not depend on the world, or --unrehearsed",
        found=rehearsal.open_end,
    )


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
    beyond = ~((rehearsal.q_rad >= robot.lower_rad - 1e-6) & (rehearsal.q_rad <= robot.upper_rad + 1e-6))
    if beyond.any():
        k, joint = np.argwhere(beyond)[0]
        raise InputError(
            "a target beyond a joint limit",
            file=program.file,
            line=int(rehearsal.line[k]),
            column=f"q{joint + 1} ({robot.joint_names[joint]})",
            found=f"{rehearsal.q_rad[k, joint]:.6f} rad",
        )
