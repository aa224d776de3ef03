"""Command about measuring a real robot: record."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from truepath.cli_options import Output

if TYPE_CHECKING:
    from truepath.recording.record import Intention

RobotHost = Annotated[str, typer.Option("--robot-host", help="address of the controller", show_default=False)]
Yes = Annotated[bool, typer.Option("--yes", help="move without asking first")]


def record(
    poses: Annotated[Path, typer.Argument(help="poses to measure, from truepath plan", show_default=False)],
    robot_host: RobotHost,
    tracker: Annotated[
        str,
        typer.Option(help="file:PATH (lines that another program appends), tcp:HOST:PORT, or simulated",
                     show_default=False),
    ],
    output: Output,
    robot: Annotated[str, typer.Option("--robot", help="model to be calibrated: its joint limits are kept")] = "ur5",
    speed_deg: Annotated[float, typer.Option(help="deg/s of the fastest joint")] = 20.0,
    acceleration_deg: Annotated[float, typer.Option(help="deg/s^2 of the fastest joint")] = 40.0,
    settle_s: Annotated[float, typer.Option(help="how long the robot must have stood still")] = 1.0,
    measure_s: Annotated[float, typer.Option(help="how long the tracker is read at each pose")] = 1.0,
    max_spread_mm: Annotated[float, typer.Option(help="of the readings; more, and the reflector is not still")] = 0.15,
    tries: Annotated[int, typer.Option(min=1, help="at each pose, before it is left for the end")] = 3,
    payload_kg: Annotated[
        float | None,
        typer.Option("--payload-kg", min=0, help="on the flange beyond the model's; default: as the robot is set"),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on with an output that was interrupted")] = False,
    yes: Yes = False,
) -> None:  # fmt: skip
    """Drive a robot through a list of poses and write down where a tracker sees its reflector.

    Every row is on the disk before the robot moves on. After a crash, a stop or Ctrl-C: --resume.
    """
    # An interruption while libraries load can get lost in them, or look like a broken installation: until there is
    # something to stop and to keep, it just ends the process. Jobs in the background inherit to ignore it.
    _on_interruption(signal.SIG_DFL)
    from truepath import console
    from truepath.cli_options import robot_named
    from truepath.pipeline import keep, require_place
    from truepath.recording.manner import Manner
    from truepath.recording.record import prepared
    from truepath.robot_link import RobotFault

    manner = Manner(speed_deg, acceleration_deg, settle_s, measure_s, max_spread_mm, tries)
    keep(output, poses)
    require_place(output)
    model = robot_named(robot)
    _on_interruption(_interrupt)
    goes_on = f"what was measured is in {output}; the same command with --resume goes on"
    try:
        with prepared(
            poses, robot_host, tracker, output, model, manner, resume=resume, payload_kg=payload_kg
        ) as (campaign, intention):  # fmt: skip
            if intention is None:
                console.out.print(f"{output} is complete: there is nothing left to measure")
                return
            _announce(intention, speed_deg)
            if not (yes or typer.confirm("Is the way clear?")):
                console.out.print("nothing was moved")
                raise typer.Exit(1)
            with console.progress("recording") as say:
                outcome = campaign.run(say)
    except RobotFault as fault:
        console.complain(f"stopped: {fault.reason}" + (f"\n{goes_on}" if output.exists() else ""))
        raise typer.Exit(1) from None
    except KeyboardInterrupt:
        console.complain(f"interrupted; {goes_on}")
        raise
    for row, why in outcome.skipped.items():
        console.warn(f"row {row + 1} of the list could not be measured: {why}")
    console.out.print(f"{outcome.measured} visits recorded in {output}" + ("" if outcome.skipped else ": complete"))
    if outcome.skipped:
        raise typer.Exit(1)


def _announce(intention: Intention, speed_deg: float) -> None:
    from truepath import console

    travel = ", ".join(f"{angle:+.1f}" for angle in intention.travel_deg)
    console.out.print(
        f"{intention.left} of {intention.total} poses are to be measured, the robot moving at "
        f"{speed_deg:g} deg/s. It goes to row {intention.first_row + 1} of the list first; "
        f"joints turn by {travel} deg."
    )
    if not intention.known:
        console.warn(
            "The robot does not stand on a way of the list: nobody has looked whether anything is in the way of its "
            "first move, straight in joint angles."
        )


def _on_interruption(handler: Any) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)


def _interrupt(number: int, frame: Any) -> NoReturn:
    raise KeyboardInterrupt
