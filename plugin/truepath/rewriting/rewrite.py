"""One program corrected: all steps in their order, nothing written to disk."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import date, datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from truepath.calibration import Calibration
from truepath.controller import Controller, controller_of
from truepath.correct import Correction, correct
from truepath.errors import CorrectionError
from truepath.guards import Finding, calibration_findings, condense
from truepath.iso9283 import ErrorStatistics
from truepath.lie import Array
from truepath.programs.program import Program, Unresolved
from truepath.rewriting.doubtful import doubtful_findings
from truepath.rewriting.express import Expressed, express, tool_errors_mm
from truepath.rewriting.named_robot import robot_named_in
from truepath.rewriting.note import write_with_note
from truepath.rewriting.open import open_program, require_same_format
from truepath.rewriting.options import RewriteOptions
from truepath.rewriting.payload import payload_findings
from truepath.rewriting.plan import Plan, plan_targets
from truepath.rewriting.said import program_findings
from truepath.rewriting.vias import Vias, choose_vias
from truepath.rewriting.watch import watch
from truepath.rewriting.ways import Ways, sample_ways
from truepath.stamp import Stamp, refuse_if_stamped, sealed


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
        note: what the note beside the corrected program says (``rewriting.note``); None where it bears a stamp, or
            stays as it is.
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
    note: Stamp | None = None

    def __repr__(self) -> str:
        total, cell = len(self.plan) + len(self.unresolved), "no cell" if self.cell is None else self.cell
        return (
            f"<RewrittenProgram {self.file}: {len(self.plan)} of {total} targets corrected, "
            f"{len(self.warnings)} warnings, looked for collisions in {cell}>"
        )

    def write(self, path: str | Path) -> None:
        """Writes the corrected program, as a whole or not at all, and the note beside it if its format needs one.

        Raises:
            InputError: it would be written over the program that was read; a name of another format; a place that
                cannot be written to.
        """
        from truepath.pipeline import keep

        keep(Path(path), Path(self.file))
        require_same_format(self.file, path)
        write_with_note(path, self.content, self.note)

    def summary(self) -> dict[str, Any]:
        """What a machine wants to know, as plain JSON types."""
        off_before, off_after = self.vias.before_mm, self.vias.after_mm
        content = self.correction.summary() if len(self.plan) else {"schema": "truepath.correction/1", "waypoints": 0}
        return {
            **content,
            "program": self.file,
            "sha256": hashlib.sha256(self.content).hexdigest(),
            "targets": len(self.plan) + len(self.unresolved),
            "corrected": len(self.plan),
            "changed": self.changed,
            "predicted_error_before_mm": _statistics(self.error_before_mm),
            "predicted_error_after_mm": _statistics(self.error_after_mm),
            "path": {
                "ways": len(off_before),
                "off_before_mm": float(off_before.max(initial=0.0)),
                "off_after_mm": float(off_after.max(initial=0.0)),
                "added": len(self.vias.added),
                "lines": self._added_by_line(),
            },
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
    path: str | Path,
    calibration: Calibration,
    options: RewriteOptions | None = None,
    *,
    today: date | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> RewrittenProgram:
    """Corrects a program of any format that truepath reads.

    Args:
        path: of the program.
        calibration: of the robot that will run it.
        options: see there.
        today: in UTC, for the age of the calibration and the stamp; default: today.
        say: is told what is being done.

    Raises:
        InputError: no program, corrected already, options that do not fit.
        CorrectionError: a guard forbids it; nothing may be written.
    """
    options = options or RewriteOptions()
    robot, region = calibration.model.robot, calibration.region.region()
    controller = controller_of(robot, options.controller_kinematics)
    say("reading the program")
    program = open_program(path, robot, region, controller, options.tool, options.start_rad)
    return rewrite(program, calibration, controller, options, today=today, say=say)


def rewrite(
    program: Program,
    calibration: Calibration,
    controller: Controller,
    options: RewriteOptions,
    *,
    today: date | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> RewrittenProgram:
    """The same for a program that was read."""
    today = today or datetime.now(timezone.utc).date()
    file, motions, model = program.file, program.motions, calibration.model
    if program.comment is not None:
        refuse_if_stamped(program.text, file, program.comment)
    say("correcting the targets")
    plan = plan_targets(motions, model.robot, controller, file, options.start_rad)
    correction = _corrected(plan, calibration, options, file)
    say("looking at what lies between them")
    X_end = controller.tool_poses(correction.q_rad, plan.motions.X_0T)
    ways, findings = sample_ways(plan, model, controller, options.max_correction_mm, file)
    tolerance_mm = options.path_tolerance_mm
    vias = choose_vias(plan, ways, X_end, tolerance_mm, lambda at: program.can_be_added_before(int(plan.index[at])))
    say("looking for limits and collisions")
    findings = [
        *calibration_findings(calibration, robot_named_in(program.text), today, options.max_age_days),
        *findings,
        *program_findings(program, options),
        *payload_findings(program, calibration, controller),
        *_too_far_off(plan, ways, vias, tolerance_mm, program),
        *doubtful_findings(
            plan, motions.possible, X_end, model, controller, tolerance_mm, options.max_correction_mm, file
        ),
        *watch(plan, correction.q_rad, ways, calibration, options.looks_in),
    ]
    _refuse(findings, file)
    say("writing")
    expressed = express(plan, correction.q_rad, ways, vias, controller, options.express)
    before, after = correction.error_before_mm, correction.error_after_mm
    if program.states_tool and len(plan):
        goal = model.goal_flange_poses(plan.X_BF)
        before, after = (
            tool_errors_mm(model.flange_poses(q), goal, controller.X_F0, plan.motions.X_0T)
            for q in (plan.q_today_rad, correction.q_rad)
        )
    content, note = _written(program, expressed, calibration, today)
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
        unresolved=tuple(sorted([*program.unresolved, *_without_posture(program, plan)], key=lambda each: each.line)),
        findings=tuple(findings),
        cell=None if options.looks_in is None else str(options.looks_in),
        note=note,
    )


def _without_posture(program: Program, plan: Plan) -> list[Unresolved]:
    found = []
    for at in plan.posture_unknown.tolist():
        why = (
            "nobody knows in which posture the robot starts: no joints are stated before (--start-deg can state them)"
            if program.motions.starts[at]
            else "in which posture the robot takes this pose cannot be told"
        )
        found.append(Unresolved(int(program.motions.line[at]), program.statement(at), why))
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


def _too_far_off(plan: Plan, ways: Ways, vias: Vias, tolerance_mm: float | None, program: Program) -> list[Finding]:
    if tolerance_mm is None:
        return []
    findings = []
    for way in np.flatnonzero(vias.after_mm > tolerance_mm).tolist():
        target = int(ways.target[way])
        possible = program.can_be_added_before(int(plan.index[target]))
        why = "blends leave no room for more targets" if possible else "no line can be added before it"
        message = f"on the way to this target the tool leaves the path by {vias.after_mm[way]:.3f} mm, and {why}"
        line, off = int(plan.motions.line[target]), float(vias.after_mm[way])
        findings.append(Finding("warning", "path", line, message, off, tolerance_mm, "mm"))
    return findings


def _refuse(findings: list[Finding], file: str) -> None:
    errors = [finding for finding in findings if finding.level == "error"]
    if errors:
        first = min((each.line for each in errors if each.line is not None), default=None)
        raise CorrectionError(
            "; ".join(line.removeprefix("error: ") for line in condense(errors)), file=file, line=first
        )


def _written(
    program: Program, expressed: Expressed, calibration: Calibration, today: date
) -> tuple[bytes, Stamp | None]:
    """The corrected program, and what the note beside it says if it cannot bear a stamp."""
    if not len(expressed.targets.index) and not expressed.vias:
        return program.raw, None  # as it was, to the byte
    stamp = Stamp.of(program.raw, calibration.to_json().encode(), today)
    if program.comment is None:
        content = program.rewritten(expressed.targets, expressed.vias, "")
        return content, replace(stamp, body_sha256=hashlib.sha256(content).hexdigest())
    content = program.rewritten(expressed.targets, expressed.vias, stamp.line(program.comment))
    return sealed(content, stamp, program.comment), None


def _statistics(values: Array) -> dict[str, float] | None:
    return vars(ErrorStatistics.of(values)).copy() if len(values) else None
