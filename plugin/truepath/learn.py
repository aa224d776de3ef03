"""From measurements to a calibration file: fit, cross-validate, describe."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from truepath.barycentre import pose_count
from truepath.calibrate import Fit, calibrate
from truepath.calibration import Calibration
from truepath.calibration_parts import HeldOutPart
from truepath.context import Context
from truepath.describe import describe, held_out
from truepath.errors import CalibrationError
from truepath.iso9283 import accuracy
from truepath.kept_away import KeptAway
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import CalibratedModel
from truepath.robot import NominalRobot

if TYPE_CHECKING:
    from truepath.residual.decision import Decision
    from truepath.residual.options import Options

FOLDS, DRIFT = 5, "frame_drift"

Progress = Callable[[str], None]


class Learnt(NamedTuple):
    """A calibration, how it came about, and what became of the networks where they were asked for.

    Attributes:
        calibration: what to save.
        fit: to all poses.
        network: why networks are in the model, or not; None where nobody asked.
    """

    calibration: Calibration
    fit: Fit
    network: str | None = None


def learn(
    robot: NominalRobot,
    measurements: Measurements,
    *,
    effects: Sequence[str] | Literal["auto"] = (),
    network: Options | None = None,
    source: str = "plant",
    progress: Progress = lambda _: None,
) -> Learnt:
    """Calibrates, and measures on held-out data what the calibration is worth.

    Args:
        robot: nominal robot.
        measurements: the data.
        effects: names of effects to fit besides the kinematics, or ``auto``: those that the data speaks for. Then
            a fifth of the poses is kept away from fit and choice, and the effects are dropped again if they do
            not lower the error there (``diagnose``).
        network: how to learn a neural residual for what has no name; it enters the calibration only if it lowers the
            error on held-out poses significantly. None: do without one.
        source: where the robot model came from, for the file.
        progress: told in plain words what is being done.

    Raises:
        CalibrationError: the data cannot carry a calibration.
        InputError: the networks are to be learnt on a device that is not there.
    """
    if effects == "auto":
        from truepath.diagnose import diagnose  # which itself describes and cross-validates

        diagnosis = diagnose(robot, measurements, source=source, plan=False, network=network, progress=progress)
        why = None if diagnosis.network is None else diagnosis.network.why
        return Learnt(diagnosis.calibration, diagnosis.fit, why)
    progress(f"fitting {len(measurements)} poses")
    fit = calibrate(robot, measurements, effects)
    if network is not None:
        decision, verification = _decide(robot, measurements, fit, effects, network, progress)
        if decision.model is not None:
            fit = with_network(fit, measurements, Context.of(measurements), network, progress)
            calibration = describe(robot, measurements, fit, source, verification, decision.proof)
            return Learnt(calibration, fit, decision.why)
    verification = cross_validate(robot, measurements.subset(~fit.outlier), effects, progress)
    why = None if network is None else decision.why
    return Learnt(describe(robot, measurements, fit, source, verification), fit, why)


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
        pose_count(groups),
        accuracies["nominal"],
        accuracies.get("kinematic"),
        accuracies["calibrated"],
    )


def on_kept_away(
    trial: KeptAway, kinematic: CalibratedModel, named: CalibratedModel, final: CalibratedModel | None
) -> HeldOutPart:
    """Accuracy on poses that were kept away, of models fitted without them.

    Args:
        trial: the poses.
        kinematic: kinematics alone.
        named: with named effects, if there are any.
        final: with networks, if there are any.
    """
    how = "a fifth of the poses, drawn at random, kept away from fit and choice of effects"
    without_networks = None
    if final is not None:
        how += " and networks, outliers left out"
        without_networks = trial.accuracy(named) if named.effects else None
    return held_out(
        how,
        pose_count(trial.measurements.groups()[trial.unseen]),
        trial.nominal_accuracy(named),
        trial.accuracy(kinematic),
        trial.accuracy(named if final is None else final),
        without_networks,
    )


def with_network(
    fit: Fit, measurements: Measurements, context: Context, options: Options, progress: Progress = lambda _: None
) -> Fit:
    """The fit with networks that have learnt what it leaves of its inliers."""
    from truepath.residual.learning import learn_ensemble
    from truepath.residual.samples import Samples

    samples = Samples.of(fit.model, measurements, context).subset(~fit.outlier)
    residual = learn_ensemble(samples, options, "learning the network from all poses", progress)
    left = samples.less(residual.shift(samples.q_rad)).miss
    return replace(
        fit,
        model=fit.model.with_residual(residual),
        sigma_position_m=float(np.sqrt(np.mean(left[:, :3] ** 2))),
        sigma_orientation_rad=float(np.sqrt(np.mean(left[:, 3:] ** 2))) if left.shape[1] > 3 else None,
    )


def _decide(
    robot: NominalRobot,
    measurements: Measurements,
    fit: Fit,
    effects: Sequence[str],
    network: Options,
    progress: Progress,
) -> tuple[Decision, HeldOutPart | None]:
    """Whether networks help on a fifth of the poses that is kept away, and what the calibration is worth there."""
    from truepath.residual.decision import decide

    context = Context.of(measurements)
    unseen = np.isin(np.arange(len(measurements)), measurements.folds(FOLDS)[0])
    trial = KeptAway(measurements, context, unseen & ~fit.outlier, ~unseen & ~fit.outlier)  # as in cross_validate

    def fit_to(rows: Array, drifting: bool) -> CalibratedModel:
        names = (*effects, DRIFT) if drifting and DRIFT not in effects else effects
        return calibrate(robot, measurements.subset(rows), names).model

    decision = decide(trial, fit_to, network, progress)
    if decision.model is None:
        return decision, None
    seen = np.flatnonzero(trial.seen)
    kinematic = calibrate(robot, measurements.subset(seen)).model
    return decision, on_kept_away(trial, kinematic, replace(decision.model, residual=None), decision.model)
