"""Lines to targets at which several motions end up: first in a loop, behind a branch. They are looked at, no more.

A target that is added on the way would be right for one of these lines and wrong for the others, so none is.
"""

from __future__ import annotations

import numpy as np

from truepath.controller import Controller
from truepath.errors import CorrectionError
from truepath.guards import Finding
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.rewriting.plan import Plan, with_tool_of
from truepath.rewriting.vias import off_the_line
from truepath.rewriting.ways import sampled


def doubtful_findings(
    plan: Plan,
    possible: Array,
    X_end: Array,
    model: CalibratedModel,
    controller: Controller,
    tolerance_mm: float | None,
    max_correction_mm: float,
    file: str,
) -> list[Finding]:
    """A warning for each target to which one of several possible lines leaves the tolerance, by the worst of them.

    Args:
        possible: ``(P, 2)`` indices of targets of the program: from where, and to where. Pairs of which a target is
            not in the plan, and those that do not end with a line, are left out.
        X_end: ``(N, 4, 4)`` what the controller must believe at the targets of the plan.
        tolerance_mm: None: no warning.
    """
    if tolerance_mm is None or not len(possible) or not len(plan):
        return []
    motions = plan.motions
    place = np.minimum(np.searchsorted(plan.index, possible), len(plan) - 1)
    known = (plan.index[place] == possible).all(axis=1) & motions.is_straight[place[:, 1]]
    start, target = place[known].T
    try:
        ways = sampled(plan, start, target, {}, model, controller, max_correction_mm, file)
    except CorrectionError as error:
        message = f"on one of the lines to a target that several motions lead to: {error.problem}; {error.found}"
        return [Finding("warning", "path", error.line, message)]
    off = off_the_line(ways, with_tool_of(motions, X_end, start, target), X_end)
    findings = []
    for end in np.unique(target[off > tolerance_mm]).tolist():
        way = int(np.argmax(np.where(target == end, off, -1.0)))
        message = (
            f"several motions lead to this target; from that in line {motions.line[start[way]]} the tool leaves the "
            f"line by {off[way]:.3f} mm, and nothing can be added for one of them alone"
        )
        findings.append(
            Finding("warning", "path", int(motions.line[end]), message, float(off[way]), tolerance_mm, "mm")
        )
    return findings
