"""Commands about programs: correct, preview, export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from truepath.cli_options import CalibrationFile, Json, MaxCorrection, Output, PayloadKg, RobotCheck, robot_named


def correct(
    path: Annotated[Path, typer.Argument(help="toolpath CSV: joint columns, or flange poses", show_default=False)],
    calibration: CalibrationFile,
    output: Output,
    robot: RobotCheck = None,
    payload_kg: PayloadKg = None,
    max_correction_mm: MaxCorrection = 5.0,
    json: Json = False,
) -> None:
    """Rewrite a path so that the real robot goes where the program means it to."""
    from truepath import console
    from truepath.calibration import load_calibration
    from truepath.files import write_atomically
    from truepath.pipeline import correct_toolpath, keep

    keep(output, path, calibration)
    with console.progress("correcting"):
        loaded = load_calibration(calibration, None if robot is None else robot_named(robot)).carrying(payload_kg)
        corrected = correct_toolpath(path, loaded, max_correction_mm=max_correction_mm)
        write_atomically(output, corrected.text)
    if json:
        console.print_json({"output": str(output), **corrected.correction.summary()})
        return
    console.print_correction(corrected.correction)
    console.out.print(f"written to {output}")


def preview(
    path: Annotated[Path, typer.Argument(help="toolpath CSV as programmed (not yet corrected)", show_default=False)],
    calibration: CalibrationFile,
    output: Output,
    robot: Annotated[str | None, typer.Option("--robot", help="model to draw; default: the calibration's own")] = None,
    magnification: Annotated[float, typer.Option(help="by how much errors are drawn larger than they are")] = 50.0,
    payload_kg: PayloadKg = None,
    max_correction_mm: MaxCorrection = 5.0,
) -> None:
    """Show a path as programmed, as the real robot would go, and as corrected: one HTML page."""
    from truepath import console
    from truepath.calibration import load_calibration
    from truepath.pipeline import correct_toolpath, keep
    from truepath.preview import write_preview

    keep(output, path, calibration)
    with console.progress("drawing"):
        loaded = load_calibration(calibration).carrying(payload_kg)
        corrected = correct_toolpath(path, loaded, max_correction_mm=max_correction_mm)
        write_preview(
            output,
            loaded,
            corrected.q_programmed,
            corrected.correction.q_rad,
            robot_source=robot or loaded.robot.source,
            magnification=magnification,
            title=path.name,
        )
    console.print_correction(corrected.correction)
    console.out.print(f"open {output} in a browser")


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
