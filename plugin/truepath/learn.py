"""From measurements to a calibration file: fit, cross-validate, describe."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from typing import Literal

import numpy as np

from truepath import calibration_parts as artefact
from truepath.calibrate import BARELY_SEEN, Fit, calibrate
from truepath.calibration import Calibration
from truepath.calibration_parts import HeldOutPart
from truepath.choose import choose_effects
from truepath.errors import CalibrationError
from truepath.iso9283 import Accuracy, accuracy
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import CalibratedModel
from truepath.region import cover
from truepath.robot import NominalRobot

FOLDS = 5

Progress = Callable[[str], None]


def learn(
    robot: NominalRobot,
    measurements: Measurements,
    *,
    effects: Sequence[str] | Literal["auto"] = (),
    source: str = "plant",
    progress: Progress = lambda _: None,
) -> tuple[Calibration, Fit]:
    """Calibrates, and measures on held-out data what the calibration is worth.

    Args:
        robot: nominal robot.
        measurements: the data.
        effects: names of effects to fit besides the kinematics, or ``auto``: those that the data speaks for. Then
            a fifth of the poses is kept away from fit and choice, and the effects are dropped again if they do
            not lower the error there.
        source: where the robot model came from, for the file.
        progress: told in plain words what is being done.

    Raises:
        CalibrationError: the data cannot carry a calibration.
    """
    if effects == "auto":
        names, verification = _choose_and_verify(robot, measurements, progress)
    else:
        names, verification = tuple(effects), None
    progress(f"fitting {len(measurements)} poses")
    fit = calibrate(robot, measurements, names)
    if verification is None:
        verification = cross_validate(robot, measurements.subset(~fit.outlier), names, progress)
    return describe(robot, measurements, fit, source, verification), fit


def _choose_and_verify(
    robot: NominalRobot, measurements: Measurements, progress: Progress
) -> tuple[tuple[str, ...], HeldOutPart | None]:
    """Effects chosen on four fifths of the poses; errors on the fifth that no fit and no choice has seen."""
    rows = measurements.folds(FOLDS)[0]
    seen = measurements.subset(np.setdiff1d(np.arange(len(measurements)), rows))
    try:
        names = choose_effects(robot, seen, progress)
    except CalibrationError:
        return (), None  # a fifth less is too little; whether all of it is enough, the fit will say
    if not names:
        return (), None
    progress("checking the effects on poses kept away")
    fit, kinematic = calibrate(robot, seen, names), calibrate(robot, seen).model
    unseen = measurements.subset(rows)
    # A gross error among the held-out poses says nothing about the model. The kinematic model judges, so that
    # no pose is left out because an effect fails on it.
    unseen = unseen.subset(_not_gross(kinematic, unseen))
    before, after = _accuracy(kinematic.predict, unseen), _accuracy(fit.model.predict, unseen)
    if after.position_mm.mean >= before.position_mm.mean:
        return (), None
    return names, _held_out(
        "a fifth of the poses, drawn at random, kept away from fit and choice of effects",
        len(unseen),
        _accuracy(fit.model.predict_nominal, unseen),
        before,
        after,
    )


def cross_validate(
    robot: NominalRobot,
    measurements: Measurements,
    effects: Sequence[str] = (),
    progress: Progress = lambda _: None,
) -> HeldOutPart | None:
    """Accuracy on poses that the fit had not seen, every pose once; with stated effects, if any.

    Returns:
        None where a fifth less data does not carry a calibration.
    """
    models = ["nominal", "kinematic", "calibrated"] if effects else ["nominal", "calibrated"]
    X_ME = {name: np.empty((len(measurements), 4, 4)) for name in models}
    for number, rows in enumerate(measurements.folds(FOLDS)):
        progress(f"cross-validation {number + 1} of {FOLDS}")
        seen = measurements.subset(np.setdiff1d(np.arange(len(measurements)), rows))
        q, payload = measurements.q_rad[rows], measurements.subset(rows).extra_payload_kg
        try:
            model = calibrate(robot, seen, effects).model
            if effects:
                X_ME["kinematic"][rows] = calibrate(robot, seen).model.predict(q, payload)
        except CalibrationError:
            return None
        X_ME["calibrated"][rows] = model.predict(q, payload)
        X_ME["nominal"][rows] = model.predict_nominal(q)
    accuracies = {name: _accuracy(lambda q, payload, X=X: X, measurements) for name, X in X_ME.items()}
    return _held_out(
        f"{FOLDS}-fold cross-validation, repeated poses together, outliers left out",
        len(measurements),
        accuracies["nominal"],
        accuracies.get("kinematic"),
        accuracies["calibrated"],
    )


def _not_gross(model: CalibratedModel, measurements: Measurements) -> Array:
    """``(N,)`` False for poses further from the model than ten times its median miss."""
    miss = np.linalg.norm(
        model.predict(measurements.q_rad, measurements.extra_payload_kg)[:, :3, 3] - measurements.p_ME, axis=1
    )
    return miss <= 10.0 * np.median(miss)


def _accuracy(predict: Callable[..., Array], measurements: Measurements) -> Accuracy:
    X_ME = predict(measurements.q_rad, measurements.extra_payload_kg)
    return accuracy(X_ME, measurements.p_ME, measurements.R_ME, measurements.groups())


def _held_out(
    method: str, poses: int, nominal: Accuracy, kinematic: Accuracy | None, calibrated: Accuracy
) -> HeldOutPart:
    def part(value: Accuracy) -> artefact.AccuracyPart:
        return artefact.AccuracyPart.model_validate(value.to_dict())

    return artefact.HeldOutPart(
        method=method,
        poses=poses,
        nominal=part(nominal),
        kinematic=None if kinematic is None else part(kinematic),
        calibrated=part(calibrated),
    )


def describe(
    robot: NominalRobot,
    measurements: Measurements,
    fit: Fit,
    source: str,
    heldout: HeldOutPart | None,
) -> Calibration:
    """The calibration file of a fit."""
    model = fit.model
    return Calibration(
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
                reason=fit.held.get(i, BARELY_SEEN if i in fit.barely_seen else None),
            )
            for i, name in enumerate(fit.names)
        ],
        effects=[artefact.EffectPart.of(fitted) for fitted in model.effects],
        region=artefact.RegionPart.of(cover(measurements.q_rad[~fit.outlier])),
        noise=artefact.NoisePart(
            position_mm=fit.sigma_position_m * 1e3,
            orientation_mrad=None if fit.sigma_orientation_rad is None else fit.sigma_orientation_rad * 1e3,
        ),
        heldout=heldout,
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
