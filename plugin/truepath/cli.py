"""The command ``truepath``: thin, and quick to start because heavy imports wait until they are needed."""

from __future__ import annotations

import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truepath import __version__
from truepath.errors import TruepathError

if TYPE_CHECKING:
    from truepath.robot import NominalRobot

MOVED = 10.0  # times the error on held-out poses: that is no calibration that aged

app = typer.Typer(
    name="truepath",
    epilog="Exit codes: 0 good, 1 a stated bound was missed, 2 bad input.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

DataFile = Annotated[Path, typer.Argument(help="measured poses", show_default=False)]
Format = Annotated[str, typer.Option("--format", help="csv, or a published set: jacobi2025, landgraf2021")]
RobotSpec = Annotated[str, typer.Option("--robot", help="ur5, ur10, ur5_cell, ur10_cell, a .urdf or a .dmd.yaml")]
CalibrationFile = Annotated[Path, typer.Option("--calibration", "-c", help="calibration.json", show_default=False)]
RobotCheck = Annotated[str | None, typer.Option("--robot", help="refuse a calibration of any other robot")]
Json = Annotated[bool, typer.Option("--json", help="print JSON for machines instead of text")]
Output = Annotated[Path, typer.Option("--output", "-o", help="file to write", show_default=False)]
MaxCorrection = Annotated[float, typer.Option("--max-correction-mm", help="refuse to move any target further")]


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"truepath {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="print the version and stop")
    ] = False,
) -> None:
    """Measure a robot, learn where it really goes, correct its offline programs, prove the gain."""


@app.command()
def calibrate(
    data: DataFile,
    output: Output,
    robot: RobotSpec,
    format: Format = "csv",
    measured_in: Annotated[
        str, typer.Option(help="tracker: nobody knows where the robot stands; world: the frame of the robot's model")
    ] = "tracker",
    probe: Annotated[
        str, typer.Option(help="place of the probe on the flange: unknown, model (frame 'reflector'), or x,y,z in mm")
    ] = "unknown",
    effects: Annotated[
        str, typer.Option(help="auto: those that the data speaks for; none: kinematics only; or names, comma-separated")
    ] = "auto",
    parameters: Annotated[bool, typer.Option("--parameters", help="also list every parameter")] = False,
    json: Json = False,
) -> None:
    """Learn the real robot from measured poses and write a calibration file."""
    from truepath import console
    from truepath.learn import learn
    from truepath.pipeline import keep, named_effects, naming
    from truepath.readers import read_measurements, with_nominal_frames

    keep(output, data)
    with console.progress("calibrating") as say:
        say("reading the robot")
        nominal = _robot(robot)
        say("reading the data")
        measurements = read_measurements(data, nominal, format)
        measurements = with_nominal_frames(measurements, *_stated_frames(nominal, measured_in, probe))
        with naming(data):
            calibration, _ = learn(nominal, measurements, effects=named_effects(effects), source=robot, progress=say)
        calibration.save(output)
    if json:
        content = calibration.model_dump(by_alias=True, include={"robot": {"name", "model_sha256"}})
        content |= calibration.model_dump(include={"heldout", "noise", "data", "parameters", "effects"})
        console.print_json({"calibration": str(output), **content})
        return
    console.print_calibration(calibration)
    if parameters:
        console.print_parameters(calibration)
    console.out.print(f"written to {output}")


@app.command()
def validate(
    data: DataFile,
    calibration: CalibrationFile,
    format: Format = "csv",
    robot: RobotCheck = None,
    refit_frames: Annotated[
        Path | None, typer.Option(help="a few other poses: estimate base and probe anew first (the tracker was moved)")
    ] = None,
    max_mean_mm: Annotated[float | None, typer.Option(help="exit with 1 if the mean position error is larger")] = None,
    max_max_mm: Annotated[float | None, typer.Option(help="exit with 1 if any position error is larger")] = None,
    json: Json = False,
) -> None:
    """Measure what a calibration is worth on poses that it has not seen (ISO 9283)."""
    from truepath import console
    from truepath import validate as validation
    from truepath.calibration import load_calibration
    from truepath.pipeline import naming
    from truepath.readers import read_measurements

    with console.progress("validating"):
        loaded = load_calibration(calibration, None if robot is None else _robot(robot))
        model = loaded.model
        measurements = read_measurements(data, model.robot, format)
        if refit_frames is not None:
            with naming(refit_frames):
                model = validation.refit_frames(model, read_measurements(refit_frames, model.robot, format))
        result = validation.validate(model, measurements)
    if json:
        console.print_json(result.to_dict())
    else:
        console.print_accuracy(f"{result.poses} poses of {data}", result.nominal, result.calibrated)
    position = result.calibrated.position_mm
    if refit_frames is None and loaded.heldout and position.mean > MOVED * loaded.heldout.calibrated.position_mm.mean:
        console.complain(
            f"far worse than the {loaded.heldout.calibrated.position_mm.mean:.3f} mm on held-out poses: if tracker, "
            "robot or probe were moved since, find the frames again with --refit-frames"
        )
    bounds = (("mean", position.mean, max_mean_mm), ("largest", position.max, max_max_mm))
    text = "the {} position error is {:.4f} mm, more than {:g} mm".format
    missed = [text(name, value, bound) for name, value, bound in bounds if bound is not None and not value <= bound]
    for reason in missed:
        console.complain(f"bound missed: {reason}")
    if missed:
        raise typer.Exit(1)


@app.command()
def correct(
    path: Annotated[Path, typer.Argument(help="toolpath CSV: joint columns, or flange poses", show_default=False)],
    calibration: CalibrationFile,
    output: Output,
    robot: RobotCheck = None,
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
        loaded = load_calibration(calibration, None if robot is None else _robot(robot))
        corrected = correct_toolpath(path, loaded, max_correction_mm=max_correction_mm)
        write_atomically(output, corrected.text)
    if json:
        console.print_json({"output": str(output), **corrected.correction.summary()})
        return
    console.print_correction(corrected.correction)
    console.out.print(f"written to {output}")


@app.command()
def preview(
    path: Annotated[Path, typer.Argument(help="toolpath CSV as programmed (not yet corrected)", show_default=False)],
    calibration: CalibrationFile,
    output: Output,
    robot: Annotated[str | None, typer.Option("--robot", help="model to draw; default: the calibration's own")] = None,
    magnification: Annotated[float, typer.Option(help="by how much errors are drawn larger than they are")] = 50.0,
    max_correction_mm: MaxCorrection = 5.0,
) -> None:
    """Show a path as programmed, as the real robot would go, and as corrected: one HTML page."""
    from truepath import console
    from truepath.calibration import load_calibration
    from truepath.pipeline import correct_toolpath, keep
    from truepath.preview import write_preview

    keep(output, path, calibration)
    with console.progress("drawing"):
        loaded = load_calibration(calibration)
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


@app.command()
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
    if loaded.effects:
        console.warn("a URDF is rigid: the named effects of the calibration are not in it")
    console.out.print(f"written to {output}")


@app.command()
def simulate(
    output: Output,
    robot: RobotSpec = "ur5_cell",
    poses: Annotated[int, typer.Option(min=1, help="number of different poses")] = 300,
    noise_mm: Annotated[float, typer.Option(min=0, help="noise of each measured coordinate")] = 0.02,
    orientation_noise_mrad: Annotated[
        float | None, typer.Option(min=0, help="measure orientation too, with this noise per axis")
    ] = None,
    repeats: Annotated[int, typer.Option(min=1, help="visits of each pose")] = 1,
    tracker: Annotated[
        bool, typer.Option("--tracker", help="in a tracker's frame instead of the cell's world")
    ] = False,
    seed: Annotated[int, typer.Option(help="of the robot's hidden errors")] = 0,
    poses_seed: Annotated[int, typer.Option(help="of poses and noise")] = 0,
    truth: Annotated[Path | None, typer.Option(help="also write what was hidden")] = None,
) -> None:
    """Make measured data of a virtual robot with hidden errors; the truth is computed by Drake."""
    from truepath import console
    from truepath.pipeline import simulate_campaign
    from truepath.virtual.simulate import Campaign

    campaign = Campaign(poses, noise_mm, orientation_noise_mrad, repeats, tracker, poses_seed)
    with console.progress("simulating"):
        rows = simulate_campaign(robot, seed, campaign, output, truth)
    console.out.print(f"{rows} measurements written to {output}")


@app.command()
def demo(
    folder: Annotated[Path, typer.Option("--folder", help="where the results go")] = Path("truepath-demo"),
    seed: Annotated[int, typer.Option(help="of the virtual robot's hidden errors")] = 0,
) -> None:
    """Run everything on the built-in virtual cell: simulate, calibrate, validate, correct, preview."""
    from truepath import console
    from truepath.demo import run_demo

    with console.progress("demo") as say:
        result = run_demo(folder, seed, say)
    console.print_accuracy("on 200 fresh poses", result.validation.nominal, result.validation.calibrated)
    console.out.print(
        f"welding path, tool error computed by Drake: mean {result.before_mm.mean():.3f} mm as programmed, "
        f"{result.after_mm.mean():.3f} mm corrected "
        f"({result.before_mm.mean() / result.after_mm.mean():.0f} times better)"
    )
    console.out.print(f"see it: open {result.page.resolve()} in a browser")


def _robot(spec: str) -> NominalRobot:
    from truepath.plants import load_robot

    return load_robot(spec)


def _stated_frames(robot: NominalRobot, measured_in: str, probe: str) -> tuple:
    from truepath.pipeline import stated_base, stated_probe

    return stated_base(robot, measured_in), stated_probe(robot, probe)


def main() -> None:
    """Entry point: errors that a user can cause end in one clear message and exit code 2."""
    try:
        app()
    except TruepathError as error:
        from truepath.console import complain

        complain(f"error: {error}")
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception:  # a fault of truepath itself must not look like a missed bound
        traceback.print_exc()
        sys.exit(3)
