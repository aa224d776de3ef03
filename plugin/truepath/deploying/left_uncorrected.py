"""Which moves of a corrected program are as they were: ``correct`` leaves what only a run can tell."""

from __future__ import annotations

from truepath.controller import Controller
from truepath.deploying.sent_program import SentProgram
from truepath.errors import CorrectionError
from truepath.programs.urscript.script import parse_script
from truepath.rewriting.plan import plan_targets
from truepath.robot import NominalRobot

MOST_LINES = 12


def uncorrected_remarks(
    program: SentProgram,
    robot: NominalRobot,
    controller: Controller,
    tool: tuple[float, ...] | None,
    start_rad: tuple[float, ...] | None,
) -> list[str]:
    """Says of a program with the stamp of a correction how many targets that could not reach; nothing if none.

    The stamp does not tell: the program is read as ``correct`` read it, and what cannot be resolved now could not be
    then.

    Args:
        tool, start_rad: stated for the correction.

    Raises:
        InputError: this is no program.
    """
    script = parse_script(program.text.encode(), program.file, tool)
    lines = [each.line for each in script.unresolved]
    try:
        plan = plan_targets(script.motions, robot, controller, program.file, start_rad)
        lines += script.motions.line[plan.posture_unknown].astype(int).tolist()
    except CorrectionError:
        pass  # out of reach: the rehearsal tells
    if not lines:
        return []
    total = len(script.motions) + len(script.unresolved)
    shown = ", ".join(map(str, sorted(lines)[:MOST_LINES])) + (" ..." if len(lines) > MOST_LINES else "")
    verb, noun = ("is", "line") if len(lines) == 1 else ("are", "lines")
    return [f"{len(lines)} of {total} targets {verb} not corrected, and the tool may be off there: {noun} {shown}"]
