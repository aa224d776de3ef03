"""What a program leaves open, and what is taken for granted instead."""

from __future__ import annotations

import numpy as np

from truepath.errors import InputError
from truepath.guards import Finding
from truepath.programs.program import Program
from truepath.programs.toolpath_program import ToolpathProgram
from truepath.rewriting.options import RewriteOptions
from truepath.tables import CUT_OFF


def program_findings(program: Program, options: RewriteOptions) -> list[Finding]:
    """Warnings about moves that are never made, poses without a tool, a posture that was chosen, and a file cut off.

    Raises:
        InputError: poses are asked for, but the program has no place for them.
    """
    findings = [
        Finding("warning", "unreached", line, "this move is never made, so it stays as it is")
        for line in program.unreached
    ]
    if isinstance(program, ToolpathProgram):
        return [*findings, *_of_a_toolpath(program, options)]
    poses = np.flatnonzero(program.motions.is_pose)
    if len(poses) and not program.states_tool:
        message = "the program sets no tool, so its poses are taken for those of the tool flange; --tcp states a tool"
        findings.append(Finding("warning", "tool", int(program.motions.line[poses[0]]), message))
    return findings


def _of_a_toolpath(program: ToolpathProgram, options: RewriteOptions) -> list[Finding]:
    table = program.toolpath.table
    cut_off = [Finding("warning", "cut-off", int(table.lines[-1]), CUT_OFF)] if table.ends_within_a_line else []
    if options.express != "poses":
        return cut_off
    if program.toolpath.X_BF is None:
        raise InputError("the toolpath has no columns for poses", file=program.file, expected="--as joints, or no --as")
    if options.start_rad is not None:
        return cut_off
    message = "the path is taken in the posture nearest to the measured ones; --start-deg states another"
    return [*cut_off, Finding("warning", "posture", int(table.lines[0]), message)]
