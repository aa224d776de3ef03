"""From measurements to a calibration file: fit, cross-validate, describe."""

from __future__ import annotations

import platform
from collections.abc import Callable
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from truepath import calibration as artefact
from truepath.calibrate import Fit, calibrate
from truepath.errors import CalibrationError
from truepath.iso9283 import Accuracy, accuracy
from truepath.measurements import Measurements
from truepath.region import cover
from truepath.robot import NominalRobot

FOLDS = 5

Progress = Callable[[str], None]


def learn(
    robot: NominalRobot, measurements: Measurements, *, source: str = "plant", progress: Progress = lambda _: None
) -> tuple[artefact.Calibration, Fit]:
    """Calibrates, and measures by cross-validation what the calibration is worth.

    Args:
        robot: nominal robot.
        measurements: the data.
        source: where the robot model came from, for the file.
        progress: told in plain words what is being done.

    Raises:
        CalibrationError: the data cannot carry a calibration.
    """
    progress(f"fitting {len(measurements)} poses")
    fit = calibrate(robot, measurements)
    heldout = cross_validate(robot, measurements.subset(~fit.outlier), progress)
    return describe(robot, measurements, fit, source, heldout), fit


def cross_validate(
    robot: NominalRobot, measurements: Measurements, progress: Progress = lambda _: None
) -> tuple[Accuracy, Accuracy] | None:
    """Accuracy of the nominal and the calibrated robot on poses that its fit had not seen, five times over.

    Returns:
        None where a fifth less data does not carry a calibration.
    """

    X_calibrated = np.empty((len(measurements), 4, 4))
    X_nominal = np.empty_like(X_calibrated)
    for number, rows in enumerate(measurements.folds(FOLDS)):
        progress(f"cross-validation {number + 1} of {FOLDS}")
        try:
            model = calibrate(robot, measurements.subset(np.setdiff1d(np.arange(len(measurements)), rows))).model
        except CalibrationError:
            return None
        X_calibrated[rows] = model.predict(measurements.q_rad[rows])
        X_nominal[rows] = model.predict_nominal(measurements.q_rad[rows])
    groups = measurements.groups()
    return (
        accuracy(X_nominal, measurements.p_ME, measurements.R_ME, groups),
        accuracy(X_calibrated, measurements.p_ME, measurements.R_ME, groups),
    )


def describe(
    robot: NominalRobot,
    measurements: Measurements,
    fit: Fit,
    source: str,
    heldout: tuple[Accuracy, Accuracy] | None,
) -> artefact.Calibration:
    """The calibration file of a fit."""
    model = fit.model
    return artefact.Calibration(
        created_utc=datetime.now(timezone.utc).isoformat(timespec="seconds"),
        software=_versions(),
        robot=artefact.RobotPart.of(robot, source),
        base=_frame(model.X_MB, model.X_MB_nominal, model.base_is_given),
        tool=_frame(model.X_FE, model.X_FE_nominal, model.tool_is_given),
        parameters=[
            artefact.Parameter(
                name=str(name),
                joint=name.joint,
                value=float(model.p[i]),
                sigma=float(fit.sigma[i]),
                unit=name.unit,
                status="held" if i in fit.held else "estimated",
                reason=fit.held.get(i),
            )
            for i, name in enumerate(fit.names)
        ],
        region=artefact.RegionPart.of(cover(measurements.q_rad[~fit.outlier])),
        noise=artefact.NoisePart(
            position_mm=fit.sigma_position_m * 1e3,
            orientation_mrad=None if fit.sigma_orientation_rad is None else fit.sigma_orientation_rad * 1e3,
        ),
        heldout=heldout
        and artefact.HeldOutPart(
            method=f"{FOLDS}-fold cross-validation, repeated poses together, outliers left out",
            nominal=artefact.AccuracyPart.model_validate(heldout[0].to_dict()),
            calibrated=artefact.AccuracyPart.model_validate(heldout[1].to_dict()),
        ),
        data=artefact.DataPart(
            file=measurements.source,
            sha256=measurements.sha256,
            poses=len(measurements),
            has_orientation=measurements.has_orientation,
            outlier_lines=measurements.line[fit.outlier].tolist(),
        ),
    )


def _frame(X: np.ndarray, X_nominal: np.ndarray, given: bool) -> artefact.FramePart:
    return artefact.FramePart(
        estimated=artefact.Pose.of(X),
        nominal=artefact.Pose.of(X_nominal),
        nominal_source="given" if given else "registered",
    )


def _versions() -> dict[str, str]:
    versions = {"python": platform.python_version()}
    for package in ("truepath", "drake", "casadi", "numpy", "scipy"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed as a package"
    return versions
