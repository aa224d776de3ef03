"""Command about measuring a real robot: record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    first_move_deg: Annotated[
        float,
        typer.Option("--first-move-deg", min=0, help="of a joint, unchecked, that --yes allows from off the list"),
    ] = 30.0,
    resume: Annotated[bool, typer.Option("--resume", help="go on with an output that was interrupted")] = False,
    yes: Yes = False,
) -> None:  # fmt: skip
    """Drive a robot through a list of poses and write down where a tracker sees its reflector.

    Every row is on the disk before the robot moves on. After a crash, a stop or Ctrl-C: --resume.
    """
    from truepath.robot_link.interruptions import ending_at_once, interruptible

    with ending_at_once():
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
    goes_on = f"what was measured is in {output}; the same command with --resume goes on"
    try:
        with interruptible(), prepared(
            poses, robot_host, tracker, output, model, manner, resume=resume, payload_kg=payload_kg
        ) as (campaign, intention):  # fmt: skip
            if intention is None:
                console.out.print(f"{output} is complete: there is nothing left to measure")
                return
            _announce(intention, speed_deg)
            if yes:
                _require_near(intention, first_move_deg)
            elif not console.agrees(_question(intention)):
                console.out.print("nothing was moved")
                raise typer.Exit(1)
            campaign.require_free_robot()  # much may have happened while the question stood
            with console.progress("recording") as say:
                outcome = campaign.run(say)
    except RobotFault as fault:
        console.complain(f"stopped: {fault.reason}" + (f"\n{goes_on}" if output.exists() else ""))
        raise typer.Exit(1) from None
    except KeyboardInterrupt as interruption:
        known = f"{interruption}; " if str(interruption) else ""  # of a robot that was in a move
        console.complain(f"interrupted; {known}" + (goes_on if output.exists() else "nothing was recorded"))
        raise
    for row, why in outcome.skipped.items():
        console.warn(f"row {row + 1} of the list could not be measured: {why}")
    console.out.print(f"{outcome.measured} visits recorded in {output}" + ("" if outcome.skipped else ": complete"))
    if outcome.skipped:
        raise typer.Exit(1)


def _question(intention: Intention) -> str:
    if intention.known:
        return "Is the way clear?"
    return (
        f"Is the way clear, also for a first move of up to {_farthest_deg(intention):.0f} deg that nobody has checked?"
    )


def _require_near(intention: Intention, first_move_deg: float) -> None:
    """Without a question only a small move may go where nobody has looked. Raises RobotFault."""
    from truepath.robot_link import RobotFault

    if not intention.known and not _farthest_deg(intention) <= first_move_deg:
        raise RobotFault(
            f"a joint would turn by {_farthest_deg(intention):.0f} deg on a first move that nobody has checked, more "
            f"than {first_move_deg:g}: leave --yes out, drive the robot to row {intention.first_row + 1} of the list, "
            "or state --first-move-deg; nothing was moved"
        )


def _farthest_deg(intention: Intention) -> float:
    return float(abs(intention.travel_deg).max())


def _announce(intention: Intention, speed_deg: float) -> None:
    from truepath import console

    travel = ", ".join(f"{angle:+.1f}" for angle in intention.travel_deg)
    console.out.print(
        f"{intention.left} of {intention.total} poses are to be measured, the robot moving at "
        f"{speed_deg:g} deg/s. It goes to row {intention.first_row + 1} of the list first; "
        f"joints turn by {travel} deg."
    )
    if intention.remark:
        console.warn(intention.remark)
    if not intention.known:
        console.warn(
            "The robot does not stand on a way of the list: nobody has looked whether anything is in the way of its "
            "first move, straight in joint angles."
        )
