"""Which causes explain what the kinematic model leaves, proved on data that took no part in fit and choice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from truepath.calibrate import Fit, KinematicFit, finish, fit_kinematics
from truepath.calibration_parts import HeldOutPart
from truepath.choose import choose
from truepath.context import Context
from truepath.describe import describe
from truepath.diagnosis import Ambiguity, Diagnosis, Finding, FoundParameter, Stage, Unexplained
from truepath.effect_fit import EffectFit, fit_effects
from truepath.effects import EFFECTS
from truepath.errors import CalibrationError
from truepath.findings import Evidence, gather
from truepath.learn import DRIFT, cross_validate, on_kept_away, with_network
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import CalibratedModel
from truepath.plan_next import poses_that_tell
from truepath.robot import NominalRobot
from truepath.summaries import summary
from truepath.unexplained import unexplained
from truepath.unseen import UnseenPoses
from truepath.verdict import not_testable, verdict

if TYPE_CHECKING:
    from truepath.residual.decision import Decision
    from truepath.residual.options import Options

PARTS = 5  # one of them is kept away from fit and choice
ENOUGH_POSES = 1600  # to see what is there, fewer with orientations; more only takes longer
ENOUGH_WITH_ORIENTATION = 640
FEW_POSES = 800  # up to which the fifth that was kept away is worth another search for waves

Progress = Callable[[str], None]


@threadpool_limits.wrap(limits=1)  # threads on matrices of this size cost more than they bring
def diagnose(
    robot: NominalRobot,
    measurements: Measurements,
    *,
    spec: str | Path | None = None,
    source: str = "plant",
    plan: bool = True,
    network: Options | None = None,
    progress: Progress = lambda _: None,
) -> Diagnosis:
    """Finds causes, extends the model with them, measures the gain.

    Args:
        robot: nominal robot.
        measurements: the data.
        spec: model of the robot's cell, to plan poses free of collision; None plans within joint limits only.
        source: where the robot model came from, for the calibration file.
        plan: also plan what to measure next where causes cannot be told apart.
        network: how to learn a neural residual for what has no name; None: do without one.
        progress: told in plain words what is being done.

    Raises:
        CalibrationError: the data cannot carry a calibration.
        InputError: the networks are to be learnt on a device that is not there.
    """
    context = Context.of(measurements)
    unseen = np.zeros(len(measurements), bool)
    unseen[measurements.folds(PARTS)[0]] = True
    progress("fitting the kinematics")
    try:
        enough = ENOUGH_WITH_ORIENTATION if measurements.has_orientation else ENOUGH_POSES
        looked_at = _some(np.flatnonzero(~unseen), enough)
        kinematic = fit_kinematics(robot, measurements.subset(looked_at), context.subset(looked_at))
        context = replace(context, R_MF=_flange_seen(kinematic, context))
        kinematic = replace(kinematic, context=context.subset(looked_at))
    except CalibrationError:
        whole = fit_kinematics(robot, measurements, context)  # says what is wrong, or that a fifth less is too little
        return _too_few(whole, source, network)
    evidence = gather(kinematic, measurements.subset(looked_at).groups(), progress)
    progress("measuring the gain on poses kept away")
    trial = UnseenPoses(kinematic, evidence, measurements, context, unseen)
    if evidence.named and trial.mean(trial.final) >= trial.mean(trial.kinematic):
        # What does not help on poses that nobody has looked at is not put into a model.
        plain = fit_effects(kinematic.fit, kinematic.context, ())
        unproved = tuple(dict.fromkeys(term.effect for term in evidence.named))
        evidence = replace(evidence, named=(), fit=plain, with_doubtful=plain, unproved=unproved)
        trial = UnseenPoses(kinematic, evidence, measurements, context, unseen)
    findings = _findings(trial, evidence)
    learnt = None if network is None else _decide(trial, looked_at, network, progress)
    progress(f"fitting all {len(measurements)} poses")
    whole = fit_kinematics(robot, measurements, context)
    fit = finish(whole, _extended(whole, evidence))
    verification: HeldOutPart | None
    if fit.model.effects or (learnt is not None and learnt.model is not None):
        verification = on_kept_away(trial, trial.kinematic, trial.final, None if learnt is None else learnt.model)
    else:
        verification = cross_validate(robot, measurements.subset(~fit.outlier), (), progress)
    if learnt is not None and network is not None and learnt.model is not None:
        fit = with_network(fit, measurements, context, network, progress)
    diagnosis = Diagnosis(
        verdict="",
        measurements=measurements,
        calibration=describe(robot, measurements, fit, source, verification, learnt.proof if learnt else None),
        fit=fit,
        outlier=fit.outlier,
        unseen=trial.unseen,
        stages=tuple(_stages(trial, findings, learnt)),
        findings=findings,
        ambiguous=tuple(_ambiguities(evidence, kinematic, spec, plan, progress)),
        unexplained=unexplained(trial, evidence),
        not_testable=tuple(not_testable(robot, context)),
        seen_models={"kinematic": trial.kinematic, "final": trial.final},
        residuals={name: trial.residual(name) for name in ("nominal", "kinematic", "final")},
        joint_view={name: trial.joint_view(name) for name in ("kinematic", "final")},
        network=learnt,
    )
    return replace(diagnosis, verdict=verdict(diagnosis))


def _extended(whole: KinematicFit, evidence: Evidence) -> EffectFit:
    """All poses with what was found: the same effects at the same places, their waves and moments chosen anew."""
    if len(whole.measurements) > FEW_POSES or not evidence.named:
        return fit_effects(whole.fit, whole.context, evidence.named)
    names = dict.fromkeys(term.effect for term in evidence.named)
    found = choose(whole.fit, whole.context, names, nameless=False).fit
    proved = {(term.effect, term.joint) for term in evidence.named}
    terms = tuple(term for term in found.terms if (term.effect, term.joint) in proved)
    if {(term.effect, term.joint) for term in terms} != proved:
        return fit_effects(whole.fit, whole.context, evidence.named)
    return fit_effects(whole.fit, whole.context, terms, prune=False, start=found)


def _findings(trial: UnseenPoses, evidence: Evidence) -> tuple[Finding, ...]:
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
            gain=trial.gain(trial.model(others), trial.final),
            parameters=tuple(parameters),
            summary=tuple(summary(part, trial.context, trial.final.robot) for part in fitted),
        )
        found.append(finding)
    return tuple(sorted(found, key=lambda f: f.gain.after_mm - f.gain.before_mm))


def _decide(trial: UnseenPoses, looked_at: Array, options: Options, progress: Progress) -> Decision:
    from truepath.residual.decision import decide  # torch takes a second to import

    def fit_to(rows: Array, drifting: bool) -> CalibratedModel:
        rows, terms = np.intersect1d(rows, looked_at), trial.evidence.named
        if len(rows) == np.count_nonzero(trial.seen[looked_at]) and not drifting:
            return trial.final
        part = fit_kinematics(trial.final.robot, trial.measurements.subset(rows), trial.context.subset(rows))
        if drifting and not any(term.effect == DRIFT for term in terms):
            terms += tuple(EFFECTS[DRIFT].terms(trial.final.robot, part.context))
        return finish(part, fit_effects(part.fit, part.context, terms, prune=drifting)).model

    return decide(trial, fit_to, options, progress)


def _stages(trial: UnseenPoses, findings: tuple[Finding, ...], learnt: Decision | None) -> list[Stage]:
    stages = [
        Stage("nominal", trial.nominal_accuracy(trial.final)),
        Stage("kinematic", trial.accuracy(trial.kinematic)),
    ]
    for count in range(1, len(findings) + 1):
        names = [finding.effect for finding in findings[:count]]
        terms = tuple(term for term in trial.evidence.named if term.effect in names)
        model = trial.final if count == len(findings) else trial.model(terms)
        stages.append(Stage("+".join(["kinematic", *names]), trial.accuracy(model)))
    if learnt is not None and learnt.model is not None:
        stages.append(Stage(f"{stages[-1].model}+network", trial.accuracy(learnt.model)))
    return stages


def _ambiguities(
    evidence: Evidence, kinematic: KinematicFit, spec: str | Path | None, plan: bool, progress: Progress
) -> list[Ambiguity]:
    found: list[Ambiguity] = []
    for confusion in evidence.confusions:
        driven = None
        if plan:
            progress("planning what to measure next")
            driven = poses_that_tell(kinematic, evidence.fit, confusion, spec)
        if driven is None:
            found.append(Ambiguity(confusion.effects, confusion.why))
            continue
        name = "poses.csv" if not found else f"poses{len(found) + 1}.csv"
        found.append(Ambiguity(confusion.effects, confusion.why, driven.q_rad[driven.measure], name, driven))
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


def _too_few(whole: KinematicFit, source: str, network: Options | None) -> Diagnosis:
    """The data just carries the kinematics."""
    fit: Fit = finish(whole, fit_effects(whole.fit, whole.context, ()))
    measurements = whole.measurements
    unseen = np.zeros(len(measurements), bool)
    p = Unexplained(False, 1.0, float("nan"), float("nan"), "neighbours")
    calibration = describe(whole.robot, measurements, fit, source, None)
    told = "Too few poses to keep some away: the kinematics was fitted, and no cause can be named."
    models = {"kinematic": fit.model, "final": fit.model}
    diagnosis = Diagnosis(told, measurements, calibration, fit, fit.outlier, unseen, (), (), (), p, (), models)
    if network is None:
        return diagnosis
    from truepath.residual.decision import impossible

    return replace(diagnosis, network=impossible())
