"""One program corrected: all steps in their order, nothing written to disk."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from datetime import date, datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from truepath.calibration import Calibration
from truepath.controller import controller_of
from truepath.correct import Correction, correct
from truepath.errors import CorrectionError, InputError
from truepath.guards import Finding, calibration_findings, condense
from truepath.iso9283 import ErrorStatistics
from truepath.lie import Array
from truepath.programs.urscript.rewrite import can_be_added_before, rewritten
from truepath.programs.urscript.script import Script, Unresolved, parse_script, read_bytes
from truepath.rewriting.express import Expressed, express, tool_errors_mm
from truepath.rewriting.named_robot import robot_named_in
from truepath.rewriting.options import RewriteOptions
from truepath.rewriting.plan import Plan, plan_targets
from truepath.rewriting.vias import Vias, choose_vias
from truepath.rewriting.watch import watch
from truepath.rewriting.ways import Ways, sample_ways
from truepath.stamp import Stamp, refuse_if_stamped

COMMENT = "#"


@dataclass(frozen=True, eq=False)
class RewrittenProgram:
    """A corrected program.

    Attributes:
        file: that was read.
        content: bytes of the corrected program.
        changed: number of targets that are written otherwise.
        plan: what it means.
        correction: of its targets.
        error_before_mm, error_after_mm: ``(N,)`` predicted distance of the tool point from where it should be.
        ways, vias: what lies between the targets, and what was added there.
        unresolved: moves that stay as they are.
        findings: warnings of the guards.
        cell: in which collisions were looked for; None: nowhere.
    """

    file: str
    content: bytes
    changed: int
    plan: Plan
    correction: Correction
    error_before_mm: Array
    error_after_mm: Array
    ways: Ways
    vias: Vias
    unresolved: tuple[Unresolved, ...]
    findings: tuple[Finding, ...] = field(default=())
    cell: str | None = None

    def summary(self) -> dict[str, Any]:
        """What a machine wants to know, as plain JSON types."""
        off_before, off_after = self.vias.before_mm, self.vias.after_mm
        return {
            "schema": "truepath.rewrite/1",
            "program": self.file,
            "sha256": hashlib.sha256(self.content).hexdigest(),
            "targets": len(self.plan) + len(self.unresolved),
            "corrected": len(self.plan),
            "changed": self.changed,
            "displacement_mm": _statistics(self.correction.displacement_mm),
            "predicted_error_before_mm": _statistics(self.error_before_mm),
            "predicted_error_after_mm": _statistics(self.error_after_mm),
            "path": {
                "ways": len(off_before),
                "off_before_mm": float(off_before.max(initial=0.0)),
                "off_after_mm": float(off_after.max(initial=0.0)),
                "added": len(self.vias.added),
                "lines": self._added_by_line(),
            },
            "outside_calibrated_region": int(self.correction.outside.sum()),
            "unresolved": [vars(each).copy() for each in self.unresolved],
            "cell": self.cell,
            "findings": [finding.to_json() for finding in self.findings],
            "warnings": self.warnings,
        }

    @property
    def warnings(self) -> list[str]:
        """Plain sentences, one for each kind of thing."""
        return [*self.correction.warnings, *condense(self.findings)]

    def _added_by_line(self) -> list[dict[str, Any]]:
        """Where targets were added, how many, and how far the tool would have left the path."""
        counts: dict[int, int] = {}
        for via in self.vias.added:
            counts[via.target] = counts.get(via.target, 0) + 1
        way = {int(target): index for index, target in enumerate(self.ways.target)}
        return [
            {
                "line": int(self.plan.motions.line[target]),
                "added": count,
                "off_before_mm": float(self.vias.before_mm[way[target]]),
                "off_after_mm": float(self.vias.after_mm[way[target]]),
            }
            for target, count in sorted(counts.items())
        ]


def rewrite_program(
    path: str | Path, calibration: Calibration, options: RewriteOptions | None = None, *, today: date | None = None
) -> RewrittenProgram:
    """Corrects a URScript program.

    Args:
        path: of the program.
        calibration: of the robot that will run it.
        options: see there.
        today: in UTC, for the age of the calibration and the stamp; default: today.

    Raises:
        InputError: no program, corrected already, options that do not fit.
        CorrectionError: a guard forbids it; nothing may be written.
    """
    return rewrite_script(read_bytes(path), str(path), calibration, options or RewriteOptions(), today)


def rewrite_script(
    raw: bytes, file: str, calibration: Calibration, options: RewriteOptions, today: date | None = None
) -> RewrittenProgram:
    """The same for a program in memory."""
    today = today or datetime.now(timezone.utc).date()
    script = parse_script(raw, file, options.tool)
    refuse_if_stamped(script.text, file, COMMENT)
    model, robot = calibration.model, calibration.model.robot
    if robot.num_joints != 6:
        raise InputError("URScript is for six joints", file=file, found=f"{robot.name} with {robot.num_joints}")
    controller = controller_of(robot, options.controller_kinematics)
    plan = plan_targets(script.motions, robot, controller, file, options.start_rad)
    unresolved = tuple(sorted([*script.unresolved, *_without_posture(script, plan)], key=lambda each: each.line))
    correction = _corrected(plan, calibration, options, file)
    X_end = controller.tool_poses(correction.q_rad, plan.motions.X_0T)
    ways, findings = sample_ways(plan, model, controller, options.max_correction_mm, file)
    vias = choose_vias(
        plan, ways, X_end, options.path_tolerance_mm, lambda at: can_be_added_before(script, int(plan.index[at]))
    )
    findings = [
        *calibration_findings(calibration, robot_named_in(script.text), today, options.max_age_days),
        *findings,
        *_too_far_off(plan, ways, vias, options.path_tolerance_mm),
        *watch(plan, correction.q_rad, ways, calibration, options.cell),
    ]
    _refuse(findings, file)
    expressed = express(plan, correction.q_rad, ways, vias, controller, options.express)
    content = _written(script, expressed, raw, calibration, today)
    goal = model.goal_flange_poses(plan.X_BF)
    before, after = (
        tool_errors_mm(model.flange_poses(q), goal, controller.X_F0, plan.motions.X_0T)
        for q in (plan.q_today_rad, correction.q_rad)
    )
    return RewrittenProgram(
        file=file,
        content=content,
        changed=len(expressed.targets.index),
        plan=plan,
        correction=correction,
        error_before_mm=before,
        error_after_mm=after,
        ways=ways,
        vias=vias,
        unresolved=unresolved,
        findings=tuple(findings),
        cell=options.cell,
    )


def _without_posture(script: Script, plan: Plan) -> list[Unresolved]:
    found = []
    for at in plan.posture_unknown.tolist():
        line = script.sites[at][0].line
        why = (
            "nobody knows in which posture the robot comes here: no joints are stated before (a start posture can be)"
            if script.motions.starts[at]
            else "in which posture the robot takes this pose cannot be told"
        )
        found.append(Unresolved(line.number, line.code.strip(), why))
    return found


def _corrected(plan: Plan, calibration: Calibration, options: RewriteOptions, file: str) -> Correction:
    if not len(plan):
        empty = np.zeros(0)
        return Correction(np.zeros((0, 6)), empty, empty, empty, np.zeros(0, bool))
    return correct(
        calibration.model,
        plan.q_rad,
        region=calibration.region.region(),
        line=plan.motions.line,
        file=file,
        max_correction_mm=options.max_correction_mm,
        previous=plan.motions.previous,
    )


def _too_far_off(plan: Plan, ways: Ways, vias: Vias, tolerance_mm: float | None) -> list[Finding]:
    if tolerance_mm is None:
        return []
    off = np.flatnonzero(vias.after_mm > tolerance_mm)
    return [
        Finding(
            "warning",
            "path",
            int(plan.motions.line[ways.target[way]]),
            "the tool leaves the path on the way to this target, and no line can be added before it",
            float(vias.after_mm[way]),
            tolerance_mm,
            "mm",
        )
        for way in off
    ]


def _refuse(findings: list[Finding], file: str) -> None:
    errors = [finding for finding in findings if finding.level == "error"]
    if errors:
        first = min((each.line for each in errors if each.line is not None), default=None)
        raise CorrectionError(
            "; ".join(line.removeprefix("error: ") for line in condense(errors)), file=file, line=first
        )


def _written(script: Script, expressed: Expressed, raw: bytes, calibration: Calibration, today: date) -> bytes:
    if not len(expressed.targets.index) and not expressed.vias:
        return raw  # as it was, to the byte
    stamp = Stamp.of(raw, calibration.to_json().encode(), today).line(COMMENT)
    return script.encoded(rewritten(script, expressed.targets, expressed.vias, stamp))


def _statistics(values: Array) -> dict[str, float] | None:
    return vars(ErrorStatistics.of(values)).copy() if len(values) else None
