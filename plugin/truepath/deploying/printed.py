"""What the command line says of a deployment."""

from __future__ import annotations

import numpy as np
from rich import box
from rich.table import Table

from truepath import console
from truepath.deploying.deploy import Prepared
from truepath.deploying.outcome import Outcome
from truepath.deploying.rehearsal import Rehearsal
from truepath.programs.motions import Kind

MOST_ROWS = 30
LONG_GAP_S = 0.1


def print_prepared(prepared: Prepared) -> None:
    """Before the question whether the robot may move."""
    rehearsal = prepared.rehearsal
    known = counted(rehearsal) if len(rehearsal) or rehearsal.open_end is None else "targets that nobody knows"
    console.out.print(f"{prepared.program.file}: {known}, for {prepared.calibration.robot.name}; the robot is ready")
    if len(rehearsal):
        away = np.degrees(rehearsal.q_rad[0] - prepared.state.q_rad)
        console.out.print(f"it goes to line {rehearsal.line[0]} first, by {_angles(away)} deg")
    for remark in prepared.remarks:
        console.warn(remark)


def print_outcome(outcome: Outcome) -> None:
    """After the run."""
    rehearsal, followed = outcome.rehearsal, outcome.followed
    tell = console.out.print if outcome.as_planned else console.complain
    noun = "motion" if len(rehearsal) == 1 else "motions"
    tell(f"{outcome.ended}; {outcome.passed} of {len(rehearsal)} {noun} made in {followed.duration_s:.1f} s")
    stops = np.flatnonzero(outcome.stops)
    if len(stops):
        off, turned = outcome.tool_off_mm[stops], np.degrees(outcome.joint_off_rad[stops])
        console.out.print(
            f"reached against commanded, where the robot was to be: tool {off.mean():.3f} mm mean, {off.max():.3f} mm "
            f"max; joints {turned.max():.4f} deg max; on the way joints lagged by "
            f"{np.degrees(followed.lag_rad):.3f} deg at most"
        )
    rounded = outcome.passed - len(stops)
    if rounded:
        blends = "1 blend, which is" if rounded == 1 else f"{rounded} blends, which are"
        console.out.print(f"not counted there: {blends} to be passed by (in brackets)")
    if followed.gap_s > LONG_GAP_S:
        passed = (
            f"{outcome.unseen} {'target was' if outcome.unseen == 1 else 'targets were'} passed unseen"
            if outcome.unseen
            else "it may have passed targets nearer"
        )
        console.warn(f"nothing was seen of the robot for {followed.gap_s:.2f} s: {passed}")
    _print_targets(outcome)
    if not followed.completed:
        console.warn("what the program has switched on stays on: see to torch, gripper and other outputs")
    if not outcome.as_planned and followed.last is not None:
        console.complain(f"joints last seen at {_angles(np.degrees(followed.last.q_rad))} deg")


def _print_targets(outcome: Outcome) -> None:
    """All of them, or the worst."""
    rehearsal = outcome.rehearsal
    known = np.flatnonzero(~np.isnan(outcome.time_s))
    shown = known
    if len(known) > MOST_ROWS:
        worst = np.argsort(np.where(outcome.stops, outcome.tool_off_mm, -1.0))[::-1][:MOST_ROWS]
        shown = np.sort(worst)
    title = "targets" if len(shown) == len(known) else f"the {MOST_ROWS} targets missed most"
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for name in ("target", "line", "move", "blend, mm", "tool off, mm", "joints off, deg"):
        table.add_column(name, justify="left" if name == "move" else "right")
    for k in shown.tolist():
        table.add_row(
            str(k + 1),
            str(rehearsal.line[k]),
            Kind(rehearsal.kind[k]).name.lower(),
            f"{1e3 * rehearsal.blend_m[k]:.1f}" if rehearsal.blend_m[k] else "",
            *_bracketed(
                bool(outcome.stops[k]),
                f"{outcome.tool_off_mm[k]:.3f}",
                f"{np.degrees(outcome.joint_off_rad[k]):.4f}",
            ),
        )
    if len(shown):
        console.out.print(table)


def counted(rehearsal: Rehearsal) -> str:
    """Targets as ``correct`` counts them: a motion along an arc has two, one of them on its way."""
    motions, through = len(rehearsal), rehearsal.through
    text = f"{motions + through} {'target' if motions + through == 1 else 'targets'}"
    if not through:
        return text
    return f"{text} ({motions} motions, {through} via {'point' if through == 1 else 'points'})"


def _bracketed(counts: bool, *numbers: str) -> tuple[str, ...]:
    return numbers if counts else tuple(f"({number})" for number in numbers)


def _angles(degrees: np.ndarray) -> str:
    return ", ".join(f"{angle:.1f}" for angle in degrees)
