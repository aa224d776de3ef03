"""What the command line prints about a corrected program."""

from __future__ import annotations

from typing import TYPE_CHECKING

from truepath.console import out, warn

if TYPE_CHECKING:
    from truepath.correct import Correction
    from truepath.rewriting.rewrite import RewrittenProgram

SHOWN = 20


def print_rewritten(program: RewrittenProgram) -> None:
    """Summary of a corrected program: targets, corrections, what was added, what to look at."""
    correction, before, after = program.correction, program.error_before_mm, program.error_after_mm
    total = len(program.plan) + len(program.unresolved)
    if len(program.plan):
        out.print(
            f"{len(program.plan)} of {total} targets corrected by {correction.displacement_mm.mean():.3f} mm on "
            f"average, {correction.displacement_mm.max():.3f} mm at most"
        )
        out.print(
            f"predicted error of the tool: mean {before.mean():.3f} mm, max {before.max():.3f} mm before; "
            f"{after.max():.1e} mm after, on top of what the calibration leaves unexplained"
        )
        if not program.changed:
            out.print("no target needs to move: the program stays as it is")
    else:
        warn("warning: the program has no target that can be corrected")
    _print_path(program)
    print_networks(correction)
    cell = "in no cell (--cell)" if program.cell is None else f"in {program.cell}"
    out.print(f"looked for collisions {cell}")
    if program.note is not None:
        out.print(f"{program.file} is taken for the original: a CSV without its note cannot be recognised as corrected")
    for warning in program.warnings:
        warn(warning if warning.startswith("warning: ") else f"warning: {warning}")
    if program.unresolved:
        warn(f"left as they are, because they cannot be corrected: {len(program.unresolved)}")
        for each in program.unresolved[:SHOWN]:
            out.print(f"  line {each.line}: {each.text}\n    {each.why}")
        if len(program.unresolved) > SHOWN:
            out.print(f"  ... and {len(program.unresolved) - SHOWN} more (--json lists all)")


def print_networks(correction: Correction) -> None:
    """How far the networks of a calibration differ along a program, if it has any that speak there."""
    if correction.networks is not None and len(correction.networks.spoken_mm):
        spread = correction.networks.spoken_mm
        out.print(f"networks: spread {spread.mean():.3f} mm on average, {spread.max():.3f} mm at most")


def _print_path(program: RewrittenProgram) -> None:
    before, after = program.vias.before_mm, program.vias.after_mm
    if not len(before):
        return
    worst = f"between targets the tool would leave the path by {before.max():.3f} mm at most"
    if not program.vias.added and not program.vias.through:
        out.print(worst)
        return
    ways = len({via.target for via in program.vias.added} | set(program.vias.through))
    out.print(f"{worst}; {len(program.vias.added)} targets added on {ways} ways keep it within {after.max():.3f} mm")
