"""The steps that commands, demo and workflows have in common."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from truepath import lie
from truepath.effects import effect_named
from truepath.errors import CalibrationError, InputError
from truepath.files import write_atomically
from truepath.lie import Array
from truepath.robot import NominalRobot
from truepath.virtual.simulate import Campaign

if TYPE_CHECKING:
    from truepath.diagnosis import Diagnosis
    from truepath.residual.options import Options

RESIDUALS = ("none", "network")


@contextmanager
def naming(file: Path) -> Iterator[None]:
    """Puts the name of the data file before what a fit complains about: the fit itself knows no files."""
    try:
        yield
    except CalibrationError as error:
        raise CalibrationError(f"{file}: {error}") from None


@contextmanager
def networks(
    residual: str, device: str, seed: int | None, checkpoint: Path | None, *others: Path
) -> Iterator[Options | None]:
    """How to learn networks as stated on the command line, or None; keeps the checkpoint until all is done.

    Args:
        residual: ``none`` or ``network``.
        device, seed: see ``residual.options.Options``.
        checkpoint: file for what has been learnt so far.
        others: files of this run that the checkpoint must not be.

    Raises:
        InputError: an unknown word, a device that is not there, a checkpoint that is none.
    """
    if residual not in RESIDUALS:
        raise InputError(f"unknown residual {residual!r}", expected=" or ".join(RESIDUALS))
    if residual == "none":
        if checkpoint is not None or seed is not None or device != "cpu":
            raise InputError("there are no networks to learn", expected="--residual network with these options")
        yield None
        return
    from truepath.residual.options import Options, require_device

    require_device(Options(device=device).device)
    if checkpoint is None:
        yield Options(seed=seed or 0, device=device)
        return
    from truepath.residual.checkpoint import Checkpoint

    # Not only what is there already: when all is done the checkpoint is deleted.
    if checkpoint.resolve() in {path.resolve() for path in others}:
        raise InputError("the checkpoint is another file of this run", file=checkpoint, expected="a file of its own")
    keep(checkpoint, *others)
    desk = Checkpoint(checkpoint)
    try:
        yield Options(seed=seed or 0, device=device, checkpoint=desk)
    except KeyboardInterrupt:
        from truepath.console import complain

        desk.save()
        complain(f"interrupted: the same command goes on from {checkpoint}")
        raise
    desk.remove()


def write_diagnosis(diagnosis: Diagnosis, folder: Path, data: Path) -> list[Path]:
    """Writes calibration, report, poses to measure next and diagnosis into a folder, which is made if need be.

    Returns:
        What was written; ``diagnosis.json`` comes last, so that it never names a file that is not there.
    """
    from truepath.planning.pose_list import to_csv
    from truepath.report import write_report

    files = [folder / name for name in ("calibration.json", "report.html")]
    poses = {folder / item.measure_next: item.driven for item in diagnosis.ambiguous if item.measure_next}
    files += [*poses, folder / "diagnosis.json"]
    require_folder(folder, files, data)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = error.strerror or "the system refuses it"
        raise InputError("the folder cannot be made", file=folder, expected="a place to write to", found=why) from None
    diagnosis.calibration.save(files[0])
    write_report(files[1], diagnosis)
    for file, driven in poses.items():
        assert driven is not None
        write_atomically(file, to_csv(driven))
    diagnosis.save(files[-1])
    return files


def require_folder(folder: Path, files: Sequence[Path], data: Path) -> None:
    """Refuses what could not be written there; makes nothing.

    Raises:
        InputError: it is no folder, or a folder stands where a file has to be, or a file is the data itself.
    """
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir():
        raise InputError("the results need a folder", file=folder, expected="a folder", found=f"the file {existing}")
    for file in files:
        keep(file, data)
        if file.is_dir():
            raise InputError("the results cannot be written", file=file, expected="a file", found="a folder")


def keep(output: Path, *inputs: Path) -> None:
    """Refuses to write over what is read."""
    for path in inputs:
        if output.exists() and path.exists() and output.samefile(path):
            raise InputError("the output is the input", file=output, expected="another file: the original is kept")


def require_place(output: Path) -> None:
    """Refuses, before the work is done, where its result could not be written."""
    if output.is_dir() or not output.absolute().parent.is_dir():
        raise InputError("the output cannot be written", file=output, expected="a file in a folder that is there")


def named_effects(text: str) -> tuple[str, ...] | Literal["auto"]:
    """Effects as stated on the command line: ``auto``, ``none``, or names with commas between them."""
    if text == "auto":
        return "auto"
    names = () if text == "none" else tuple(name.strip() for name in text.split(","))
    for name in names:
        effect_named(name)
    return names


def stated_base(robot: NominalRobot, measured_in: str) -> Array | None:
    """X_MB as stated on the command line: None for ``tracker``, the model's own for ``world``."""
    if measured_in == "tracker":
        return None
    if measured_in == "world":
        return robot.X_WB
    raise InputError(f"unknown measurement frame {measured_in!r}", expected="tracker or world")


def stated_probe(robot: NominalRobot, probe: str) -> Array | None:
    """X_FE as stated on the command line: ``unknown``, ``model``, or ``x,y,z`` in mm on the flange."""
    if probe == "unknown":
        return None
    if probe == "model":
        if robot.X_FR is None:
            raise InputError(
                f"the model of {robot.name} has no frame called 'reflector'",
                expected="--probe x,y,z, or a cell with a reflector (ur5_cell, ur10_cell)",
            )
        return robot.X_FR
    try:
        offset = np.array([float(part) for part in probe.split(",")])
    except ValueError:
        offset = np.array([math.nan])
    if offset.shape != (3,) or not (np.abs(offset) < 1e5).all():
        raise InputError(f"cannot read the place of the probe {probe!r}", expected="unknown, model, or x,y,z in mm")
    return lie.make_pose(translation=offset * 1e-3)


def simulate_campaign(
    spec: str, seed: int, campaign: Campaign, output: Path, truth: Path | None, hide: Sequence[str] = ()
) -> int:
    """Measures a virtual robot, with the named causes hidden in it, and writes the CSV (and what was hidden).

    Returns:
        The number of rows.

    Raises:
        InputError: an unknown cause, a place where nothing can be written.
    """
    from truepath.virtual.hidden_causes import draw_causes
    from truepath.virtual.real_robot import RealRobot
    from truepath.virtual.simulate import free_poses, measure, to_csv, truth_json

    if truth is not None and (truth.resolve() == output.resolve() or not truth.parent.is_dir() or truth.is_dir()):
        raise InputError("the truth cannot be written here", file=truth, expected="another file in an existing folder")
    real = RealRobot(spec, seed)
    causes = draw_causes(real, hide)
    q_rad = free_poses(real, campaign.poses, np.random.default_rng(campaign.seed))
    measurements = measure(real, q_rad, campaign, causes)
    write_atomically(output, to_csv(measurements))
    if truth is not None:
        write_atomically(truth, truth_json(real, campaign, causes))
    return len(measurements)
