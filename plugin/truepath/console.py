"""What the command line prints: tables for people on standard output, progress and errors on standard error."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from truepath.calibration import Calibration
    from truepath.calibration_parts import AccuracyPart
    from truepath.calibration_residual import ResidualPart
    from truepath.diagnosis import Diagnosis
    from truepath.iso9283 import Accuracy

CROSS_VALIDATED = "these errors are cross-validated, to decide by; those in the table are of the poses kept away"

# Soft wrap: a path or a sentence is one line wherever it goes; terminals break lines by themselves.
out = Console(highlight=False, markup=False, soft_wrap=True)
err = Console(stderr=True, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def progress(title: str) -> Iterator[Callable[[str], None]]:
    """A spinner while work goes on; the yielded function says what is being done now."""
    with err.status(title) as status:
        yield lambda text: status.update(f"{title}: {text}")


def warn(text: str) -> None:
    """Something that a person should not overlook, among the results."""
    out.print(text, style="yellow")


def complain(text: str) -> None:
    """Why the exit code is not 0."""
    err.print(text, style="red")


def agrees(question: str) -> bool:
    """Asks a person. What was typed before the question could be seen is no answer to it."""
    import sys

    import typer

    if sys.stdin.isatty():
        import termios

        termios.tcflush(sys.stdin, termios.TCIFLUSH)
    return typer.confirm(question)


def print_json(content: Any) -> None:
    """For machines: nothing but JSON on standard output."""
    print(json.dumps(content, indent=1, allow_nan=False))


def print_accuracy(
    title: str,
    before: Accuracy | AccuracyPart,
    after: Accuracy | AccuracyPart,
    between: Accuracy | AccuracyPart | None = None,
    named: Accuracy | AccuracyPart | None = None,
) -> None:
    """A table of errors of several models of a robot.

    Args:
        title: of the table.
        before, after: of the nominal robot, and of the calibrated one.
        between: with calibrated kinematics only.
        named: with named causes too, but without networks.
    """
    models = {"nominal": before, "kinematics": between, "named causes": named, "calibrated": after}
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("error")
    table.add_column("model")
    for name in ("mean", "rms", "p95", "max"):
        table.add_column(name, justify="right")
    for label, field in (
        ("position, mm", "position_mm"),
        ("distance, mm", "distance_mm"),
        ("orientation, mrad", "orientation_mrad"),
    ):
        for model, accuracy in models.items():
            errors = None if accuracy is None else getattr(accuracy, field)
            if errors is not None:
                numbers = (f"{getattr(errors, name):.3f}" for name in ("mean", "rms", "p95", "max"))
                table.add_row(label if model == "nominal" else "", model, *numbers, end_section=model == "calibrated")
    out.print(table)


def print_calibration(calibration: Calibration, asked: Mapping[str, str] | None = None) -> None:
    """What a person wants to know after calibrating.

    Args:
        calibration: what was found.
        asked: what became of each effect that was asked for by name, as ``asked_effects.became_of`` has it.
    """
    data, noise = calibration.data, calibration.noise
    kind = "6D" if data.has_orientation else "3D"
    out.print(f"{calibration.robot.name} calibrated on {data.poses} poses ({kind}) of {data.file}", style="bold")
    if calibration.heldout is not None:
        held_out = calibration.heldout
        how = "cross-validated" if "cross-validation" in held_out.method else "kept away"
        title = f"on {held_out.poses} poses that the fit had not seen ({how})"
        print_accuracy(title, held_out.nominal, held_out.calibrated, held_out.kinematic, held_out.named)
    else:
        warn("too few poses to hold any back: the accuracy on new poses is not known")
    spread = f"{noise.position_mm:.4f} mm per axis"
    if noise.orientation_mrad is not None:
        spread += f", {noise.orientation_mrad:.4f} mrad per axis"
    out.print(f"left unexplained (noise and what the model lacks): {spread}")
    _print_frames(calibration)
    _print_effects(calibration, asked or {})
    if calibration.residual is not None:
        out.print(f"networks: {_networks(calibration.residual)}")
    if data.outlier_lines:
        shown = ", ".join(map(str, data.outlier_lines[:12])) + (" ..." if len(data.outlier_lines) > 12 else "")
        warn(f"{len(data.outlier_lines)} outliers left out, lines {shown}")
    remarkable = [p for p in calibration.parameters if p.reason]
    for status, reason in dict.fromkeys((p.status, p.reason) for p in remarkable):
        names = ", ".join(p.name for p in remarkable if p.reason == reason)
        out.print(f"{'held at nominal, ' if status == 'held' else ''}{reason}:\n  {names}")


def print_diagnosis(diagnosis: Diagnosis) -> None:
    """What a person wants to know after a diagnosis; the rest is in the report."""
    out.print(diagnosis.verdict, style="bold")
    data = diagnosis.to_dict()["data"]
    title = f"error on {data['unseen_poses']} poses kept away, mm"
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for name, side in (("model", "left"), ("mean", "right"), ("p95", "right"), ("max", "right")):
        table.add_column(name, justify=side)  # type: ignore[arg-type]
    for stage in diagnosis.stages:
        errors = stage.accuracy.position_mm
        table.add_row(stage.model, f"{errors.mean:.3f}", f"{errors.p95:.3f}", f"{errors.max:.3f}")
    if diagnosis.stages:
        out.print(table)
    for finding in diagnosis.findings:
        gain = finding.gain
        low, high = gain.ci95_mm
        p_value = "< 1e-12" if finding.p_value < 1e-12 else f"{finding.p_value:.1g}"
        out.print(f"{finding.effect.replace('_', ' ')}: {finding.cause}", style="bold")
        for line in finding.summary:
            out.print(f"  {line}")
        out.print(
            f"  p {p_value}; mean error {gain.before_mm:.4f} -> {gain.after_mm:.4f} mm "
            f"(gain {low:.4f} to {high:.4f} mm)\n  remedy: {finding.remedy}"
        )
    if diagnosis.network is not None:
        out.print("neural residual", style="bold")
        out.print(f"  {diagnosis.network.why}")
        if diagnosis.network.model is not None:
            out.print(f"  {CROSS_VALIDATED}")
    _print_frames(diagnosis.calibration)
    for item in diagnosis.ambiguous:
        warn(f"cannot be told apart: {', '.join(item.effects)}")
        out.print(f"  {item.why}" + (f"\n  poses that would tell: {item.measure_next}" if item.measure_next else ""))
    for hint in diagnosis.unexplained.hints:
        warn(f"not explained: {hint}")
    for blind in diagnosis.not_testable:
        out.print(f"not testable: {blind.effect.replace('_', ' ')} ({blind.why})")
    rows = [str(row) for row in data["outliers"]]
    if rows:
        warn(f"{len(rows)} rows left out as gross errors: {', '.join(rows[:12])}{' ...' if len(rows) > 12 else ''}")


def print_network(calibration: Calibration, why: str) -> None:
    """What became of networks that were asked for."""
    out.print(f"neural residual: {why}")
    if calibration.residual is not None:
        out.print(f"  {CROSS_VALIDATED}")


def _print_frames(calibration: Calibration) -> None:
    from truepath.found_frames import found_frames

    for frame in found_frames(calibration):
        out.print(frame.line)
        if frame.warning is not None:
            warn(f"warning: {frame.warning}")


def _print_effects(calibration: Calibration, asked: Mapping[str, str]) -> None:
    from truepath.report.words import joints_phrase

    for name in dict.fromkeys(effect.name for effect in calibration.effects):
        found = [effect for effect in calibration.effects if effect.name == name]
        joints = [effect.joint for effect in found if effect.joint is not None]
        place = (f" on {joints_phrase(joints)}" if joints else "") + (" (as asked)" if asked else "")
        out.print(f"{name}{place}: {found[0].cause}; {found[0].remedy}")
    if asked:
        from truepath.asked_effects import IN_MODEL, ONLY_THESE, STAND_IN

        out.print("effects asked for:")
        for name, what in asked.items():
            out.print(f"  {name}: {what}")
        out.print(f"  {ONLY_THESE}")
        if IN_MODEL in asked.values():
            warn(f"  {STAND_IN}")


def print_parameters(calibration: Calibration) -> None:
    """Every parameter with its standard deviation."""
    table = Table(title="axis deviations", title_justify="left")
    for name, side in (("parameter", "left"), ("value", "right"), ("sigma", "right"), ("unit", "left"), ("", "left")):
        table.add_column(name, justify=side)  # type: ignore[arg-type]
    for p in calibration.parameters:
        if p.joint is None:
            continue
        unit = {"m": "mm", "rad": "mrad"}[p.unit]
        sigma = "" if p.status == "held" else f"{1e3 * p.sigma:.4f}"
        table.add_row(p.name, f"{1e3 * p.value:.4f}", sigma, unit, "held" if p.status == "held" else "")
    out.print(table)


def _networks(residual: ResidualPart) -> str:
    """How many, of what size. What proved them is said by the command, which says why they are left out as well."""
    sizes = sorted(len(network.hidden) for network in residual.networks)
    size = f"{sizes[0]}" if sizes[0] == sizes[-1] else f"{sizes[0]} to {sizes[-1]}"
    return f"{len(sizes)} of {size} hidden neurons"
