"""Commands about measured poses: calibrate, diagnose, validate."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truepath.cli_options import (
    CalibrationFile,
    DataFile,
    Device,
    Format,
    Json,
    MeasuredIn,
    Output,
    Probe,
    Residual,
    Resume,
    RobotCheck,
    RobotSpec,
    Seed,
    robot_named,
)

if TYPE_CHECKING:
    from truepath.measurements import Measurements
    from truepath.robot import NominalRobot

RESULTS = ("calibration.json", "report.html", "diagnosis.json")
MOVED = 10.0  # times the error on held-out poses: that is no calibration that aged


def calibrate(
    data: DataFile,
    output: Output,
    robot: RobotSpec,
    format: Format = "csv",
    measured_in: MeasuredIn = "tracker",
    probe: Probe = "unknown",
    effects: Annotated[
        str, typer.Option(help="auto: those that the data speaks for; none: kinematics only; or names, comma-separated")
    ] = "auto",
    residual: Residual = "none",
    parameters: Annotated[bool, typer.Option("--parameters", help="also list every parameter")] = False,
    device: Device = "cpu",
    seed: Seed = None,
    checkpoint: Resume = None,
    json: Json = False,
) -> None:
    """Learn the real robot from measured poses and write a calibration file."""
    from truepath import console
    from truepath.asked_effects import became_of
    from truepath.found_frames import found_frames
    from truepath.learn import learn
    from truepath.pipeline import keep, named_effects, naming, networks, require_place

    keep(output, data)
    require_place(output)
    names = named_effects(effects)
    with networks(residual, device, seed, checkpoint, data, output) as options, console.progress("calibrating") as say:
        say("reading the robot")
        nominal = robot_named(robot)
        say("reading the data")
        measurements = _read(data, nominal, format, measured_in, probe)
        with naming(data):
            calibration, _, network = learn(
                nominal, measurements, effects=names, network=options, source=robot, progress=say
            )
        asked = {} if names == "auto" else became_of(names, nominal, measurements, calibration.effects)
        calibration.save(output)
    if json:
        content = calibration.model_dump(by_alias=True, include={"robot": {"name", "model_sha256"}})
        content |= calibration.model_dump(include={"heldout", "noise", "data", "parameters", "effects"})
        content["frames"] = [asdict(frame) for frame in found_frames(calibration)]
        console.print_json({"calibration": str(output), "network": network, "asked": asked, **content})
        return
    console.print_calibration(calibration, asked)
    if network is not None:
        console.print_network(calibration, network)
    if parameters:
        console.print_parameters(calibration)
    console.out.print(f"written to {output}")


def diagnose(
    data: DataFile,
    folder: Annotated[Path, typer.Option("--output", "-o", help="folder for the results", show_default=False)],
    robot: RobotSpec,
    format: Format = "csv",
    measured_in: MeasuredIn = "tracker",
    probe: Probe = "unknown",
    residual: Residual = "none",
    device: Device = "cpu",
    seed: Seed = None,
    checkpoint: Resume = None,
    json: Json = False,
) -> None:
    """Show what the simulation gets wrong, name the cause, extend the model, measure the gain."""
    from truepath import console
    from truepath.diagnose import diagnose as find_causes
    from truepath.measure_next import OTHER_NAME, beside
    from truepath.pipeline import naming, networks, require_folder, write_diagnosis

    results = [folder / name for name in (*RESULTS, "poses.csv", f"{OTHER_NAME}.csv")]
    with networks(residual, device, seed, checkpoint, data, *results) as options, console.progress("diagnosing") as say:
        say("reading the robot")
        nominal = robot_named(robot)
        say("reading the data")
        measurements = _read(data, nominal, format, measured_in, probe)
        with naming(data):
            require_folder(folder, [folder / name for name in RESULTS], data)
            diagnosis = find_causes(nominal, measurements, spec=robot, source=robot, network=options, progress=say)
        diagnosis = beside(diagnosis, folder, data)
        say("writing the report")
        files = write_diagnosis(diagnosis, folder, data)
    if json:
        console.print_json(diagnosis.to_dict())
        return
    console.print_diagnosis(diagnosis)
    console.out.print("written: " + ", ".join(str(file) for file in files))


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
        loaded = load_calibration(calibration, None if robot is None else robot_named(robot))
        model = loaded.model
        measurements = read_measurements(data, model.robot, format)
        if refit_frames is not None:
            with naming(refit_frames):
                few = read_measurements(refit_frames, model.robot, format)
                validation.require_other_poses(few, measurements)
                model = validation.refit_frames(model, few)
        result = validation.validate(model, measurements)
    if json:
        console.print_json(result.to_dict())
    else:
        console.print_accuracy(f"{result.poses} poses of {data}", result.nominal, result.calibrated)
    position = result.calibrated.position_mm
    if measurements.sha256 == loaded.data.sha256:
        (console.complain if json else console.warn)(
            f"{calibration} was made from these very poses: this is how well it fits them, no proof for others"
        )
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


def _read(data: Path, robot: NominalRobot, format: str, measured_in: str, probe: str) -> Measurements:
    from truepath.pipeline import stated_base, stated_probe
    from truepath.readers import read_measurements, with_nominal_frames

    measurements = read_measurements(data, robot, format)
    return with_nominal_frames(measurements, stated_base(robot, measured_in), stated_probe(robot, probe))
