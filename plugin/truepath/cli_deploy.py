"""Command about a real robot that runs a corrected program: deploy."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truepath.cli_options import CalibrationFile, ControllerKinematics, Json, PayloadKg, StartDeg, Tcp
from truepath.errors import InputError

if TYPE_CHECKING:
    from truepath.deploying.deploy import Prepared
    from truepath.deploying.outcome import Outcome
    from truepath.robot_link import RobotLink


def deploy(
    program: Annotated[Path, typer.Argument(help="script, as truepath correct wrote it", show_default=False)],
    robot_host: Annotated[str, typer.Option("--robot-host", help="address of the controller", show_default=False)],
    calibration: CalibrationFile,
    record: Annotated[
        Path | None, typer.Option("--output", "-o", help="CSV of all joints during the run", show_default=False)
    ] = None,
    payload_kg: PayloadKg = None,
    controller_kinematics: ControllerKinematics = "nominal",
    tcp: Tcp = None,
    start_deg: StartDeg = None,
    start_within_deg: Annotated[
        float, typer.Option(min=0, help="how far any joint may be from where the program starts")
    ] = 30.0,
    stall_s: Annotated[
        float | None,
        typer.Option(
            "--stall-s",
            help="stop a robot that stands for so long while the program runs; default: 20, or twice the program's "
            "longest wait; said, not stopped, where a sensor decides how it goes on",
            show_default=False,
        ),
    ] = None,
    uncorrected: Annotated[
        bool, typer.Option("--uncorrected", help="allow a program that was not corrected with this calibration")
    ] = False,
    unrehearsed: Annotated[
        bool, typer.Option("--unrehearsed", help="allow a program of which nobody knows where it goes first")
    ] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="look at everything, move nothing")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="move without asking first")] = False,
    json: Json = False,
) -> None:
    """Run a corrected program on the robot, watch it, and say where the robot went.

    Nothing moves unless safety, payload, TCP, posture and the program's stamp are as the calibration needs them.
    Ctrl-C stops the robot.
    """
    from truepath.robot_link.interruptions import ending_at_once, interruptible

    with ending_at_once():
        from truepath import console
        from truepath.calibration import load_calibration
        from truepath.deploying.deploy import DeployOptions, NotReady, prepare
        from truepath.deploying.load import bare_arm
        from truepath.deploying.printed import print_outcome, print_prepared
        from truepath.deploying.sent_program import read_program, require_correction
        from truepath.pipeline import keep, require_place
        from truepath.rewriting.stated import stated_options
        from truepath.robot_link import RobotFault, RobotLink

        if stall_s is not None and not (math.isfinite(stall_s) and stall_s > 0):
            raise InputError("no such time", expected="--stall-s above 0", found=f"{stall_s:g}")
        if record is not None:
            keep(record, program, calibration)
            require_place(record)
        sent = read_program(program)
        loaded = load_calibration(calibration).carrying(payload_kg)
        if not uncorrected:
            require_correction(sent, loaded)
        if not (yes or dry_run or sys.stdin.isatty()):  # not before the files: a faulty one is the nearer trouble
            raise InputError("nobody is there to ask whether the robot may move", expected="a terminal, or --yes")
        stated = stated_options(loaded, None, controller_kinematics, None, 0.0, "none", start_deg, tcp)
        options = DeployOptions(
            uncorrected,
            unrehearsed,
            controller_kinematics,
            stated.tool,
            stated.start_rad,
            math.radians(start_within_deg),
            stall_s,
        )
        bare_arm(loaded.model.robot)  # read by Drake, once
    try:
        with interruptible(), RobotLink(robot_host, options.timeout_s) as link:
            with console.progress("looking at program and robot"):
                prepared = prepare(program, loaded, link, options)
            if not json:
                print_prepared(prepared)
            if dry_run:
                _say_dry(prepared, json)
                return
            _ask(yes)
            outcome = _run(prepared, link, record)
    except NotReady as fault:
        for reason in fault.obstacles:
            console.complain(f"refused: {reason}")
        raise typer.Exit(1) from None
    except RobotFault as fault:
        console.complain(f"refused: {fault.reason}")
        raise typer.Exit(1) from None
    if json:
        console.print_json({"program": str(program), "record": record and str(record), **outcome.summary()})
    else:
        print_outcome(outcome)
    if outcome.followed.interrupted:
        raise typer.Exit(130)
    if not outcome.as_planned:
        raise typer.Exit(1)


def _run(prepared: Prepared, link: RobotLink, record: Path | None) -> Outcome:
    from truepath import console
    from truepath.deploying.deploy import run
    from truepath.robot_link import RobotState

    rehearsal = prepared.rehearsal
    with console.progress("running") as say:

        def watched(passed: int, state: RobotState) -> None:
            if passed < len(rehearsal):
                say(f"target {passed + 1} of {len(rehearsal)}, line {rehearsal.line[passed]}")
            else:
                say("past the last target that is known")

        return run(prepared, link, record, watched, lambda text: console.err.print(text, style="yellow"))


def _ask(yes: bool) -> None:
    """Before anything moves."""
    from truepath import console

    if not yes and not console.agrees("The robot will move. Is the way clear?"):
        console.out.print("nothing was moved")
        raise typer.Exit(1)


def _say_dry(prepared: Prepared, json: bool) -> None:
    from truepath import console

    if json:
        rehearsal, remarks = prepared.rehearsal, list(prepared.remarks)
        content = {"ready": True, "targets": len(rehearsal), "via_points": rehearsal.through, "remarks": remarks}
        console.print_json({"schema": "truepath.deployment/1", **content})
    else:
        console.out.print("nothing was moved (--dry-run)")
