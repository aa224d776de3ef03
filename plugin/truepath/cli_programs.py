"""Commands about programs: correct, preview, export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from truepath.cli_options import (
    CalibrationFile,
    CellSpec,
    ControllerKinematics,
    Express,
    Json,
    MaxCorrection,
    Output,
    PathTolerance,
    PayloadKg,
    ProgramFile,
    RobotCheck,
    StartDeg,
    Tcp,
    robot_named,
)
from truepath.errors import InputError


def correct(
    path: ProgramFile,
    calibration: CalibrationFile,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="file to write", show_default=False)] = None,
    robot: RobotCheck = None,
    payload_kg: PayloadKg = None,
    max_correction_mm: MaxCorrection = 5.0,
    express: Express = None,
    controller_kinematics: ControllerKinematics = "nominal",
    path_tolerance_mm: PathTolerance = 0.05,
    cell: CellSpec = None,
    start_deg: StartDeg = None,
    tcp: Tcp = None,
    allow_partial: Annotated[
        bool, typer.Option("--allow-partial", help="exit with 0 though some targets cannot be resolved")
    ] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="print the summary, write nothing")] = False,
    json: Json = False,
) -> None:
    """Rewrite a program so that the real robot goes where the program means it to."""
    from truepath import console, console_programs
    from truepath.calibration import load_calibration
    from truepath.pipeline import keep, require_place
    from truepath.rewriting.note import note_of
    from truepath.rewriting.open import require_same_format
    from truepath.rewriting.rewrite import rewrite_program
    from truepath.rewriting.stated import stated_options

    if output is None and not dry_run:
        raise InputError("nowhere to write to", expected="--output FILE, or --dry-run")
    if output is not None:
        keep(output, path, calibration)
        require_place(output)
        require_same_format(path, output)
    with console.progress("correcting") as say:
        say("reading the calibration")
        loaded = load_calibration(calibration, None if robot is None else robot_named(robot)).carrying(payload_kg)
        options = stated_options(
            loaded, express, controller_kinematics, path_tolerance_mm, max_correction_mm, cell, start_deg, tcp
        )
        rewritten = rewrite_program(path, loaded, options, say=say)
        if output is not None and not dry_run:
            rewritten.write(output)
    written = None if dry_run or output is None else str(output)
    note = None if written is None or rewritten.note is None else str(note_of(written))
    if json:
        console.print_json({"output": written, "note": note, **rewritten.summary()})
    else:
        console_programs.print_rewritten(rewritten)
        beside = "" if note is None else f", with its note {Path(note).name}"
        console.out.print("nothing is written (--dry-run)" if written is None else f"written to {written}{beside}")
    if rewritten.unresolved and not allow_partial:
        raise typer.Exit(1)


def preview(
    path: Annotated[Path, typer.Argument(help="program as programmed (not yet corrected)", show_default=False)],
    calibration: CalibrationFile,
    output: Output,
    robot: Annotated[str | None, typer.Option("--robot", help="model to draw; default: the calibration's own")] = None,
    magnification: Annotated[
        str,
        typer.Option(
            metavar="FACTOR|auto",
            help="by how much errors are drawn larger than they are; auto: so that they are well visible",
        ),
    ] = "50",
    payload_kg: PayloadKg = None,
    max_correction_mm: MaxCorrection = 5.0,
    controller_kinematics: ControllerKinematics = "nominal",
    cell: CellSpec = None,
    start_deg: StartDeg = None,
    tcp: Tcp = None,
) -> None:
    """Show a path as programmed, as the real robot would go, and as corrected: one HTML page."""
    from truepath import console, console_programs
    from truepath.calibration import load_calibration
    from truepath.controller import controller_of
    from truepath.pipeline import keep, require_place
    from truepath.preview import write_program_preview
    from truepath.preview.toolpaths import stated_magnification
    from truepath.rewriting.open import SCRIPTS
    from truepath.rewriting.rewrite import rewrite_program
    from truepath.rewriting.stated import stated_options

    keep(output, path, calibration)
    require_place(output)
    drawn_larger = stated_magnification(magnification)
    with console.progress("drawing") as say:
        loaded = load_calibration(calibration).carrying(payload_kg)
        options = stated_options(loaded, None, controller_kinematics, None, max_correction_mm, cell, start_deg, tcp)
        rewritten = rewrite_program(path, loaded, options, say=say)
        page = write_program_preview(
            output,
            loaded,
            rewritten,
            controller_of(loaded.model.robot, controller_kinematics),
            robot_source=robot or loaded.robot.source,
            magnification=drawn_larger,
            title=path.name,
            text=path.read_text("utf-8", "replace") if path.suffix.lower() in SCRIPTS else None,
        )
    console_programs.print_rewritten(rewritten)
    tell = console.warn if page.expected.known_mm is None else console.out.print
    tell(f"to be expected on the robot with the correction: {page.expected.source}")
    console.out.print(f"errors are drawn {page.magnification:g} times larger; open {output} in a browser")


def export(
    calibration: CalibrationFile,
    output: Output,
    robot: Annotated[str | None, typer.Option("--robot", help="nominal URDF; default: the calibration's own")] = None,
) -> None:
    """Write a URDF with the calibrated kinematics, for Drake and other tools."""
    from truepath import console
    from truepath.calibration import load_calibration
    from truepath.export import write_calibrated_urdf
    from truepath.model_files import find_urdf
    from truepath.pipeline import keep

    keep(output, calibration)
    loaded = load_calibration(calibration)
    urdf = find_urdf(robot or loaded.robot.source, tuple(loaded.robot.joint_names), loaded.robot.name)
    write_calibrated_urdf(loaded.model, urdf, output)
    left_out = ["the named effects"] * bool(loaded.effects) + ["the networks"] * (loaded.residual is not None)
    if left_out:
        console.warn(f"a URDF is rigid: {' and '.join(left_out)} of the calibration are not in it")
    console.out.print(f"written to {output}")
