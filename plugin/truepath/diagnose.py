"""Which causes explain what the kinematic model leaves, proved on data that took no part in fit and choice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats
from threadpoolctl import threadpool_limits

from truepath import lie
from truepath.calibrate import Fit, KinematicFit, finish, fit_kinematics
from truepath.calibration_parts import HeldOutPart
from truepath.context import Context
from truepath.describe import describe, held_out
from truepath.diagnosis import Ambiguity, Diagnosis, Finding, FoundParameter, Gain, Stage, Unexplained
from truepath.effect_fit import fit_effects
from truepath.effects import EFFECTS
from truepath.effects.base import Term
from truepath.errors import CalibrationError
from truepath.findings import SIGNIFICANT, Evidence, gather
from truepath.iso9283 import Accuracy, accuracy
from truepath.learn import cross_validate
from truepath.leftover import alike_by_chance, noise_floor_mm
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import CalibratedModel
from truepath.motions import ChainPoses, Moves
from truepath.nameless import NAMELESS
from truepath.plan_next import poses_that_tell
from truepath.robot import NominalRobot
from truepath.summaries import summary
from truepath.verdict import not_testable, verdict

PARTS = 5  # one of them is kept away from fit and choice
ENOUGH_POSES = 1600  # to see what is there; more only takes longer
A_PATTERN = 0.001  # p value of a pattern that no form describes
GROSS = 10.0  # times the median miss: no model is to blame for such a reading
LEAST_LEVER_M = 0.03

Progress = Callable[[str], None]


@threadpool_limits.wrap(limits=1)  # threads on matrices of this size cost more than they bring
def diagnose(
    robot: NominalRobot,
    measurements: Measurements,
    *,
    spec: str | Path | None = None,
    source: str = "plant",
    plan: bool = True,
    progress: Progress = lambda _: None,
) -> Diagnosis:
    """Finds causes, extends the model with them, measures the gain.

    Args:
        robot: nominal robot.
        measurements: the data.
        spec: model of the robot's cell, to plan poses free of collision; None plans within joint limits only.
        source: where the robot model came from, for the calibration file.
        plan: also plan what to measure next where causes cannot be told apart.
        progress: told in plain words what is being done.

    Raises:
        CalibrationError: the data cannot carry a calibration.
    """
    context = Context.of(measurements)
    unseen = np.zeros(len(measurements), bool)
    unseen[measurements.folds(PARTS)[0]] = True
    progress("fitting the kinematics")
    try:
        looked_at = _some(np.flatnonzero(~unseen), ENOUGH_POSES)
        kinematic = fit_kinematics(robot, measurements.subset(looked_at), context.subset(looked_at))
        context = replace(context, R_MF=_flange_seen(kinematic, context))
        kinematic = replace(kinematic, context=context.subset(looked_at))
    except CalibrationError:
        whole = fit_kinematics(robot, measurements, context)  # says what is wrong, or that a fifth less is too little
        return _too_few(whole, source)
    evidence = gather(kinematic, measurements.subset(looked_at).groups(), progress)
    progress("measuring the gain on poses kept away")
    trial = _Trial(kinematic, evidence, measurements, context, unseen)
    if evidence.named and trial.mean(trial.final) >= trial.mean(trial.kinematic):
        # What does not help on poses that nobody has looked at is not put into a model.
        evidence = replace(evidence, named=(), fit=fit_effects(kinematic.fit, kinematic.context, ()))
        trial = _Trial(kinematic, evidence, measurements, context, unseen)
    findings = _findings(trial, evidence)
    progress(f"fitting all {len(measurements)} poses")
    whole = fit_kinematics(robot, measurements, context)
    fit = finish(whole, fit_effects(whole.fit, context, evidence.named))
    verification: HeldOutPart | None
    if fit.model.effects:
        how = "a fifth of the poses, drawn at random, kept away from fit and choice of effects"
        accuracies = (trial.accuracy(model) for model in ("nominal", "kinematic", "final"))
        verification = held_out(how, int(trial.unseen.sum()), *accuracies)
    else:
        verification = cross_validate(robot, measurements.subset(~fit.outlier), (), progress)
    unexplained = _unexplained(trial, evidence)
    diagnosis = Diagnosis(
        verdict="",
        measurements=measurements,
        calibration=describe(robot, measurements, fit, source, verification),
        fit=fit,
        outlier=fit.outlier,
        unseen=trial.unseen,
        stages=tuple(_stages(trial, findings)),
        findings=findings,
        ambiguous=tuple(_ambiguities(evidence, kinematic, spec, plan, progress)),
        unexplained=unexplained,
        not_testable=tuple(not_testable(robot, context)),
        seen_models={"kinematic": trial.kinematic, "final": trial.final},
        residuals={name: trial.residual(name) for name in ("nominal", "kinematic", "final")},
        joint_view={name: trial.joint_view(name) for name in ("kinematic", "final")},
    )
    return replace(diagnosis, verdict=verdict(diagnosis))


class _Trial:
    """Models fitted to the poses that were looked at, on those that were not.

    Attributes:
        kinematic, final: without and with the findings.
        unseen: ``(N,)`` True for poses to judge by; gross errors are left out, the kinematic model being the judge,
            so that no pose is left out because an effect fails on it.
    """

    def __init__(
        self, fit: KinematicFit, evidence: Evidence, measurements: Measurements, context: Context, unseen: Array
    ) -> None:
        self.fit, self.evidence, self.measurements, self.context = fit, evidence, measurements, context
        self.kinematic, self.final = self.model(()), finish(fit, evidence.fit).model
        miss = np.linalg.norm(self.kinematic.predict(context)[:, :3, 3] - measurements.p_ME, axis=1)
        self.sane = miss <= GROSS * np.median(miss)
        self.unseen = unseen & self.sane

    def model(self, terms: tuple[Term, ...]) -> CalibratedModel:
        """The kinematics with some terms."""
        return finish(self.fit, fit_effects(self.fit.fit, self.fit.context, terms, prune=False)).model

    def predict(self, model: CalibratedModel | str) -> Array:
        """``(N, 4, 4)``."""
        if model == "nominal":
            return self.final.predict_nominal(self.context)
        chosen = getattr(self, model) if isinstance(model, str) else model
        return chosen.predict(self.context)

    def accuracy(self, model: CalibratedModel | str) -> Accuracy:
        """On the unseen poses."""
        part = self.measurements.subset(self.unseen)
        return accuracy(self.predict(model)[self.unseen], part.p_ME, part.R_ME, part.groups())

    def errors_mm(self, model: CalibratedModel) -> Array:
        """``(k,)`` on the unseen poses."""
        error = model.predict(self.context.subset(self.unseen))[:, :3, 3] - self.measurements.p_ME[self.unseen]
        return 1e3 * np.linalg.norm(error, axis=1)

    def mean(self, model: CalibratedModel) -> float:
        """Mean error on the unseen poses, mm."""
        return float(self.errors_mm(model).mean())

    def gain(self, without: CalibratedModel) -> Gain:
        """Of the final model over another, with Student's interval of the paired difference."""
        before, after = self.errors_mm(without), self.errors_mm(self.final)
        difference = before - after
        mean, k = float(difference.mean()), len(difference)
        half = float(stats.t.ppf(0.975, k - 1) * difference.std(ddof=1) / np.sqrt(k)) if k > 1 else np.inf
        return Gain(float(before.mean()), float(after.mean()), (mean - half, mean + half))

    def residual(self, model: str) -> Array:
        """``(N, m)`` predicted less measured, in M."""
        X_ME = self.predict(model)
        residual = X_ME[:, :3, 3] - self.measurements.p_ME
        if self.measurements.R_ME is None:
            return residual
        turn = lie.rotation_vector(X_ME[:, :3, :3] @ np.swapaxes(self.measurements.R_ME, 1, 2))
        return np.concatenate([residual, turn], axis=1)

    def joint_view(self, model: str) -> Array:
        """``(N, n)`` turn of each joint alone that would explain the residual of a pose best, rad."""
        final, residual = self.final, self.residual(model)[:, :3]
        phi = final.true_joints(self.context)
        chain = ChainPoses.of(final.robot, final.p, phi, final.X_MB, final.X_FE)
        view = np.full(phi.shape, np.nan)
        for joint in range(1, phi.shape[1] + 1):
            moved = chain.displacement(Moves.JOINT, joint)[:, :3, 0]
            lever2 = np.sum(moved**2, axis=1)
            seen = lever2 > LEAST_LEVER_M**2
            view[seen, joint - 1] = -np.sum(moved * residual, axis=1)[seen] / lever2[seen]
        return view


def _findings(trial: _Trial, evidence: Evidence) -> tuple[Finding, ...]:
    found = []
    for name in dict.fromkeys(term.effect for term in evidence.named):
        others = tuple(term for term in evidence.named if term.effect != name)
        fitted = [part for part in evidence.fit.effects if part.term.effect == name]
        parameters = [
            FoundParameter(p.name, part.term.joint, float(value), float(sigma), p.unit)
            for part in fitted
            for p, value, sigma in zip(part.term.parameters, part.values, part.sigma, strict=True)
        ]
        finding = Finding(
            effect=name,
            joints=tuple(sorted({part.term.joint for part in fitted if part.term.joint is not None})),
            cause=EFFECTS[name].cause,
            remedy=EFFECTS[name].remedy,
            p_value=evidence.p_values[name],
            log_odds=evidence.log_odds[name],
            gain=trial.gain(trial.model(others)),
            parameters=tuple(parameters),
            summary=tuple(summary(part, trial.context, trial.final.robot) for part in fitted),
        )
        found.append(finding)
    return tuple(sorted(found, key=lambda f: f.gain.after_mm - f.gain.before_mm))


def _stages(trial: _Trial, findings: tuple[Finding, ...]) -> list[Stage]:
    stages = [Stage("nominal", trial.accuracy("nominal")), Stage("kinematic", trial.accuracy("kinematic"))]
    for count in range(1, len(findings) + 1):
        names = [finding.effect for finding in findings[:count]]
        terms = tuple(term for term in trial.evidence.named if term.effect in names)
        model = trial.final if count == len(findings) else trial.model(terms)
        stages.append(Stage("+".join(["kinematic", *names]), trial.accuracy(model)))
    return stages


def _unexplained(trial: _Trial, evidence: Evidence) -> Unexplained:
    looked_at = trial.fit.measurements.subset(evidence.fit.inlier)
    residual = evidence.fit.residual[evidence.fit.inlier]
    p_alike = alike_by_chance(looked_at, residual, evidence.fit.sigma)
    p_forms = [evidence.p_values[term.effect] for term in evidence.nameless]
    floor, source = noise_floor_mm(looked_at, residual)
    places: dict[str, set[int]] = {}
    for term in evidence.nameless:
        places.setdefault(term.effect, set()).update([] if term.joint is None else [term.joint])
    hints = tuple(
        NAMELESS[name].hint + (f" (joint {', '.join(str(joint) for joint in sorted(joints))})" if joints else "")
        for name, joints in places.items()
    )
    return Unexplained(
        structured=min([*p_forms, 1.0]) < SIGNIFICANT or p_alike < A_PATTERN,
        p_value=float(min([*p_forms, p_alike])),
        heldout_mm=trial.mean(trial.final),
        noise_floor_mm=floor,
        floor_from=source,
        hints=hints,
    )


def _ambiguities(
    evidence: Evidence, kinematic: KinematicFit, spec: str | Path | None, plan: bool, progress: Progress
) -> list[Ambiguity]:
    found: list[Ambiguity] = []
    for confusion in evidence.confusions:
        poses = None
        if plan:
            progress("planning what to measure next")
            poses = poses_that_tell(kinematic, evidence.fit, confusion, spec)
        name = None if poses is None else ("poses.csv" if not found else f"poses{len(found) + 1}.csv")
        found.append(Ambiguity(confusion.effects, confusion.why, poses, name))
    return found


def _flange_seen(kinematic: KinematicFit, context: Context) -> Array:
    """``(N, 3, 3)`` how the flange stands for the tracker, by the kinematics alone."""
    model = finish(kinematic, fit_effects(kinematic.fit, kinematic.context, ())).model
    return (model.X_MB @ model.flange_poses(context))[:, :3, :3]


def _some(rows: Array, count: int) -> Array:
    """At most so many rows, drawn at random, in order."""
    if len(rows) <= count:
        return rows
    return np.sort(np.random.default_rng(0).permutation(rows)[:count])


def _too_few(whole: KinematicFit, source: str) -> Diagnosis:
    """The data just carries the kinematics."""
    fit: Fit = finish(whole, fit_effects(whole.fit, whole.context, ()))
    measurements = whole.measurements
    unseen = np.zeros(len(measurements), bool)
    p = Unexplained(False, 1.0, float("nan"), float("nan"), "neighbours")
    calibration = describe(whole.robot, measurements, fit, source, None)
    told = "Too few poses to keep some away: the kinematics was fitted, and no cause can be named."
    models = {"kinematic": fit.model, "final": fit.model}
    return Diagnosis(told, measurements, calibration, fit, fit.outlier, unseen, (), (), (), p, (), models)
