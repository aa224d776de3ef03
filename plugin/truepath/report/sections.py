"""What the sections of the page say, in words; plain text throughout, escaped by the template."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

import numpy as np

from truepath.barycentre import pose_count
from truepath.calibration_parts import Parameter
from truepath.diagnosis import Diagnosis, Finding, FoundParameter
from truepath.measurements import Measurements
from truepath.report.drawn import Drawn, Plot
from truepath.report.residual_plots import of_finding
from truepath.report.words import (
    counted,
    effect_name,
    in_readable_unit,
    inside_sentence,
    interval,
    joints_phrase,
    listed,
    millimetres_decimals,
    odds,
    probability,
    sentence,
    significant,
    with_sign,
)

COLUMN_OF_FIELD = {"time_s": "t_s"}  # where a field is called otherwise than the column to record


@dataclass(frozen=True)
class ParameterRow:
    """A line of a table of parameters, as text."""

    name: str
    joint: str
    value: str
    sigma: str
    unit: str
    held: str | None = None


@dataclass(frozen=True)
class FindingCard:
    """A cause that was found, as text and plots."""

    identity: str
    effect: str
    title: str
    place: str
    cause: str
    remedy: str
    summary: tuple[str, ...]
    probability: str
    odds: str
    before: str
    after: str
    gain: str
    interval: str
    is_sure: bool
    plots: list[Plot]
    parameters: list[ParameterRow]


def facts(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """What was measured, of which robot, when and with what."""
    measurements, calibration = diagnosis.measurements, diagnosis.calibration
    n = len(calibration.robot.joint_names)
    kind = "position and orientation (6D)" if measurements.has_orientation else "position (3D)"
    software = ", ".join(f"{name} {number}" for name, number in calibration.software.items())
    return [
        ("File", measurements.source),
        ("Robot", f"{calibration.robot.name}, {n} joints"),
        ("Measured", f"{_poses(measurements)}, {kind}"),
        ("Written", calibration.created_utc.replace("T", " ").replace("+00:00", " UTC")),
        ("Software", software),
        ("SHA-256 of the data", measurements.sha256),
        ("SHA-256 of the robot model", calibration.robot.model_sha256),
    ]


def subtitle(diagnosis: Diagnosis) -> list[str]:
    """The same in one line."""
    measurements, calibration = diagnosis.measurements, diagnosis.calibration
    return [
        f"robot {calibration.robot.name}",
        f"{_poses(measurements)} ({'6D' if measurements.has_orientation else '3D'})",
        calibration.created_utc[:10],
        f"truepath {calibration.software.get('truepath', '')}".strip(),
        f"SHA-256 {measurements.sha256[:12]}…",
    ]


def counts(diagnosis: Diagnosis) -> dict[str, int]:
    """Numbers of different poses, however often visited, and of rows that were left out."""
    outlier, unseen = np.asarray(diagnosis.outlier, bool), np.asarray(diagnosis.unseen, bool)
    groups = diagnosis.measurements.groups()
    return {
        "poses": pose_count(groups),
        "outliers": int(outlier.sum()),
        "unseen": pose_count(groups[unseen & ~outlier]),
        "seen": pose_count(groups[~unseen & ~outlier]),
    }


def _poses(measurements: Measurements) -> str:
    """``94 poses``, ``94 poses in 100 readings``."""
    poses, rows = pose_count(measurements.groups()), len(measurements)
    return counted(poses, "pose") + ("" if poses == rows else f" in {counted(rows, 'reading')}")


def findings(diagnosis: Diagnosis, drawn: Drawn) -> list[FindingCard]:
    """One card each, in the order of the diagnosis."""
    return [_card(diagnosis, drawn, finding, k + 1) for k, finding in enumerate(diagnosis.findings)]


def _card(diagnosis: Diagnosis, drawn: Drawn, finding: Finding, number: int) -> FindingCard:
    gain = finding.gain
    decimals = millimetres_decimals(min(gain.before_mm, gain.after_mm))
    return FindingCard(
        identity=f"finding-{number}",
        effect=finding.effect,
        title=effect_name(finding.effect),
        place=joints_phrase(finding.joints),
        cause=sentence(finding.cause),
        remedy=sentence(finding.remedy),
        summary=finding.summary,
        probability=probability(finding.p_value),
        odds=odds(finding.log_odds),
        before=f"{gain.before_mm:.{decimals}f}",
        after=f"{gain.after_mm:.{decimals}f}",
        gain=with_sign(f"{gain.before_mm - gain.after_mm:.{decimals}f}"),
        interval=interval(gain.ci95_mm, decimals),
        is_sure=min(gain.ci95_mm) > 0,
        plots=of_finding(drawn, diagnosis, finding, number),
        parameters=[_found_row(parameter) for parameter in finding.parameters],
    )


def unexplained(diagnosis: Diagnosis) -> dict[str, Any]:
    """What is left."""
    left = diagnosis.unexplained
    if not (math.isfinite(left.heldout_mm) and math.isfinite(left.noise_floor_mm)):
        return {"known": False, "structured": left.structured, "hints": [sentence(hint) for hint in left.hints]}
    decimals = millimetres_decimals(min(left.heldout_mm, left.noise_floor_mm))
    source = {"repeats": "repeated visits of the same poses", "neighbours": "differences between neighbouring poses"}
    return {
        "known": True,
        "structured": left.structured,
        "probability": probability(left.p_value),
        "heldout": f"{left.heldout_mm:.{decimals}f}",
        "floor": f"{left.noise_floor_mm:.{decimals}f}",
        "ratio": significant(left.heldout_mm / left.noise_floor_mm, 2) if left.noise_floor_mm > 0 else None,
        "floor_from": source.get(left.floor_from, left.floor_from),
        "hints": [sentence(hint) for hint in left.hints],
    }


def ambiguous(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Causes that cannot be told apart; the link is safe whatever the file is called."""
    items = []
    for item in diagnosis.ambiguous:
        names = [effect_name(effect) for effect in item.effects]
        items.append(
            {
                "title": listed([names[0], *(inside_sentence(name) for name in names[1:])], "or") if names else "",
                "why": sentence(item.why),
                "file": item.measure_next,
                "link": None if item.measure_next is None else "./" + quote(item.measure_next),
                "poses": None if item.poses is None else counted(len(item.poses), "pose"),
            }
        )
    return items


def not_testable(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Effects for which a column is missing."""
    return [
        {
            "name": effect_name(item.effect),
            "why": sentence(item.why),
            "columns": [COLUMN_OF_FIELD.get(column, column) for column in item.columns],
        }
        for item in diagnosis.not_testable
    ]


def outliers(diagnosis: Diagnosis) -> dict[str, Any]:
    """Rows left out: number in the order of measurement from 1, line of the file, error against the kinematic model."""
    from truepath.effects.outlier import EFFECT

    rows = np.flatnonzero(diagnosis.outlier)
    residual = diagnosis.residuals.get("kinematic")
    length = None if residual is None else 1e3 * np.linalg.norm(np.asarray(residual)[:, :3], axis=1)
    return {
        "cause": sentence(EFFECT.cause),
        "remedy": sentence(EFFECT.remedy),
        "rows": [
            (int(row) + 1, int(diagnosis.measurements.line[row]), "" if length is None else significant(length[row]))
            for row in rows
        ],
    }


def kinematics(diagnosis: Diagnosis) -> list[ParameterRow]:
    """Every parameter of the kinematic part."""
    return [_kinematic_row(parameter) for parameter in diagnosis.calibration.parameters]


def _found_row(parameter: FoundParameter) -> ParameterRow:
    value, sigma, unit = in_readable_unit(parameter.value, parameter.sigma, parameter.unit)
    return ParameterRow(parameter.name, "" if parameter.joint is None else str(parameter.joint), value, sigma, unit)


def _kinematic_row(parameter: Parameter) -> ParameterRow:
    is_held = parameter.status == "held"
    value, sigma, unit = in_readable_unit(parameter.value, None if is_held else parameter.sigma, parameter.unit)
    joint = "" if parameter.joint is None else str(parameter.joint)
    held = (parameter.reason or "held at nominal") if is_held else None
    return ParameterRow(parameter.name, joint, value, sigma, unit, held)
