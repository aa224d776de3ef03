"""What a diagnosis says: the content of ``diagnosis.json``, and what the report draws besides."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truepath.barycentre import pose_count
from truepath.calibrate import Fit
from truepath.calibration import Calibration
from truepath.files import write_atomically
from truepath.iso9283 import Accuracy
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import CalibratedModel

if TYPE_CHECKING:
    from truepath.planning.pose_list import PoseList
    from truepath.residual.decision import Decision

SCHEMA = "truepath.diagnosis/1"


@dataclass(frozen=True)
class Stage:
    """Errors of a model on the poses that neither fit nor choice has seen: nominal, kinematic, kinematic+..."""

    model: str
    accuracy: Accuracy


@dataclass(frozen=True)
class FoundParameter:
    """One number of a finding, SI units; joint from 1 or None."""

    name: str
    joint: int | None
    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class Gain:
    """Mean error on unseen poses without and with something, and the 95 % interval of the difference, mm."""

    before_mm: float
    after_mm: float
    ci95_mm: tuple[float, float]


@dataclass(frozen=True)
class Finding:
    """A cause that passed.

    Attributes:
        effect: name.
        joints: from 1, those that have it; empty where no joint is concerned.
        cause, remedy: plain sentences.
        p_value: probability of so good a prediction of held-out readings by chance, in the less favourable of
            two cross-validations (random, blocks of neighbours), times the number of hypotheses tried.
        log_odds: logarithm of the Bayes factor for the model with it against the one without.
        gain: on the poses that neither fit nor choice has seen, all other findings being in the model.
        parameters: with standard deviations.
        summary: its size in a few words, a line for each joint or place.
    """

    effect: str
    joints: tuple[int, ...]
    cause: str
    remedy: str
    p_value: float
    log_odds: float
    gain: Gain
    parameters: tuple[FoundParameter, ...]
    summary: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Ambiguity:
    """Causes that these data cannot tell apart.

    Attributes:
        effects: their names; ``kinematic`` stands for the geometry of the robot.
        why: what a reader needs to know.
        poses: ``(k, n)`` joints that would separate them, rad, or None where poses alone cannot.
        measure_next: name of the file with these poses, in the folder of the diagnosis.
        driven: what is in that file: the same poses, and rows to pass through on the way.
    """

    effects: tuple[str, ...]
    why: str
    poses: Array | None = None
    measure_next: str | None = None
    driven: PoseList | None = None


@dataclass(frozen=True)
class Unexplained:
    """What is left when all findings are in the model.

    Attributes:
        structured: whether it follows a pattern that no named cause carries.
        p_value: of there being none.
        heldout_mm: mean error on unseen poses.
        noise_floor_mm: mean error that noise alone makes there, from repeats or from neighbours.
        floor_from: ``repeats`` or ``neighbours``.
        hints: what the pattern goes with, in plain words.
    """

    structured: bool
    p_value: float
    heldout_mm: float
    noise_floor_mm: float
    floor_from: str
    hints: tuple[str, ...] = ()


@dataclass(frozen=True)
class NotTestable:
    """An effect that these data cannot test, and the columns to record next time."""

    effect: str
    columns: tuple[str, ...]
    why: str


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything that was found out.

    Attributes:
        verdict: in one sentence.
        measurements: the data, N poses.
        calibration: fitted to all of it, with the findings in.
        fit: that fit itself.
        outlier: ``(N,)`` True for rows left out.
        unseen: ``(N,)`` True for the rows kept away from fit and choice.
        stages: in the order in which the model grew.
        seen_models: ``nominal`` is not among them: ``kinematic`` and ``final``, fitted without the unseen rows.
        residuals: by stage (``nominal``, ``kinematic``, ``final``) ``(N, m)`` predicted less measured, in M;
            m and rad. The models are those of ``seen_models``.
        joint_view: by stage (``kinematic``, ``final``) ``(N, n)``: the turn of each joint alone that would explain
            the residual of a pose best, rad. NaN where a joint moves the probe by too little.
        network: what became of the networks, where they were asked for.
    """

    verdict: str
    measurements: Measurements
    calibration: Calibration
    fit: Fit
    outlier: Array
    unseen: Array
    stages: tuple[Stage, ...]
    findings: tuple[Finding, ...]
    ambiguous: tuple[Ambiguity, ...]
    unexplained: Unexplained
    not_testable: tuple[NotTestable, ...]
    seen_models: dict[str, CalibratedModel]
    residuals: dict[str, Array] = field(default_factory=dict)
    joint_view: dict[str, Array] = field(default_factory=dict)
    network: Decision | None = None

    def to_dict(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        rows = [row + 1 for row, left_out in enumerate(self.outlier) if left_out]
        groups = self.measurements.groups()
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "data": {
                "file": self.measurements.source,
                "sha256": self.measurements.sha256,
                "rows": len(groups),
                "poses": pose_count(groups),
                "unseen_poses": pose_count(groups[self.unseen]),
                "outliers": rows,
            },
            "stages": [_stage(stage) for stage in self.stages],
            "findings": [_finding(finding) for finding in self.findings],
            "ambiguous": [
                {"effects": list(item.effects), "why": item.why, "measure_next": item.measure_next}
                for item in self.ambiguous
            ],
            "unexplained": {
                "structured": self.unexplained.structured,
                "p_value": self.unexplained.p_value,
                "heldout_mm": _number(self.unexplained.heldout_mm),
                "noise_floor_mm": _number(self.unexplained.noise_floor_mm),
                "noise_floor_from": self.unexplained.floor_from,
                "hints": list(self.unexplained.hints),
            },
            "network": None if self.network is None else _network(self.network),
            "not_testable": [
                {"effect": item.effect, "record": list(item.columns), "why": item.why} for item in self.not_testable
            ],
        }

    def save(self, path: str | Path) -> None:
        """Writes ``diagnosis.json`` as a whole or not at all."""
        write_atomically(path, json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n")


def _number(value: float) -> float | None:
    """JSON knows no number that is none."""
    return value if math.isfinite(value) else None


def _stage(stage: Stage) -> dict[str, Any]:
    content: dict[str, Any] = {"model": stage.model}
    accuracy = stage.accuracy
    for key, part in (("heldout_mm", accuracy.position_mm), ("heldout_mrad", accuracy.orientation_mrad)):
        if part is not None:
            content[key] = {"mean": part.mean, "p95": part.p95, "max": part.max}
    return content


def _network(network: Decision) -> dict[str, Any]:
    gain = network.gain
    return {
        "entered": network.model is not None,
        "why": network.why,
        "p_value": network.proof.p_value,
        "cross_validated_mm": {"before": network.proof.before_mm, "after": network.proof.after_mm},
        "heldout_gain_mm": None if gain is None else _gain(gain),
    }


def _gain(gain: Gain) -> dict[str, Any]:
    return {"before": gain.before_mm, "after": gain.after_mm, "ci95": list(gain.ci95_mm)}


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "effect": finding.effect,
        "joints": list(finding.joints),
        "cause": finding.cause,
        "remedy": finding.remedy,
        "summary": list(finding.summary),
        "p_value": finding.p_value,
        "log_odds": finding.log_odds,
        "heldout_gain_mm": _gain(finding.gain),
        "parameters": [
            {"name": p.name, "joint": p.joint, "value": p.value, "sigma": p.sigma, "unit": p.unit}
            for p in finding.parameters
        ],
    }
