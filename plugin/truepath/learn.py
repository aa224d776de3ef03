"""From measurements to a calibration file: fit, cross-validate, describe."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np

from truepath.calibrate import Fit, calibrate
from truepath.calibration import Calibration
from truepath.calibration_parts import HeldOutPart
from truepath.context import Context
from truepath.describe import describe, held_out
from truepath.errors import CalibrationError
from truepath.iso9283 import accuracy
from truepath.measurements import Measurements
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
            not lower the error there (``diagnose``).
        source: where the robot model came from, for the file.
        progress: told in plain words what is being done.

    Raises:
        CalibrationError: the data cannot carry a calibration.
    """
    if effects == "auto":
        from truepath.diagnose import diagnose  # which itself describes and cross-validates

        diagnosis = diagnose(robot, measurements, source=source, plan=False, progress=progress)
        return diagnosis.calibration, diagnosis.fit
    progress(f"fitting {len(measurements)} poses")
    fit = calibrate(robot, measurements, effects)
    verification = cross_validate(robot, measurements.subset(~fit.outlier), effects, progress)
    return describe(robot, measurements, fit, source, verification), fit


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
    context = Context.of(measurements)
    X_ME = {name: np.empty((len(measurements), 4, 4)) for name in models}
    for number, rows in enumerate(measurements.folds(FOLDS)):
        progress(f"cross-validation {number + 1} of {FOLDS}")
        seen, left_out = measurements.subset(np.setdiff1d(np.arange(len(measurements)), rows)), context.subset(rows)
        try:
            model = calibrate(robot, seen, effects).model
            if effects:
                X_ME["kinematic"][rows] = calibrate(robot, seen).model.predict(left_out)
        except CalibrationError:
            return None
        X_ME["calibrated"][rows] = model.predict(left_out)
        X_ME["nominal"][rows] = model.predict_nominal(left_out)
    groups = measurements.groups()
    accuracies = {name: accuracy(X, measurements.p_ME, measurements.R_ME, groups) for name, X in X_ME.items()}
    return held_out(
        f"{FOLDS}-fold cross-validation, repeated poses together, outliers left out",
        len(measurements),
        accuracies["nominal"],
        accuracies.get("kinematic"),
        accuracies["calibrated"],
    )
