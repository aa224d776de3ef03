"""The residual before and after: over joint angles, over time, over temperature, and over what a cause depends on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath.diagnosis import Diagnosis, Finding
from truepath.lie import Array
from truepath.poe import axis_and_flange_poses
from truepath.report.canvas import (
    MOST_VECTOR_POINTS,
    draw_points,
    drawn_rows,
    mark_angles,
    median_size,
    moving_median,
    new_axes,
    symmetric_limit,
    write_svg,
)
from truepath.report.drawn import COLOURS, PALE_COLOURS, STAGE_NAMES, Drawn, Plot
from truepath.report.words import counted, significant

SMALL, LARGE = (360, 214), (400, 236)
FINE_BINS, COARSE_BINS = 140, 60  # a joint may err tens of times a turn; a drift is slow
ANGLE = "angle of the joint, °"


@dataclass(frozen=True, eq=False)
class Axis:
    """What residuals are drawn over: ``(K,)`` values, their label, and into how many bins a trend is resolved."""

    values: Array
    label: str
    bins: int = COARSE_BINS


@dataclass(frozen=True)
class Frame:
    """A plot before anything is in it. ``identity`` is unique in the page."""

    identity: str
    title: str
    y_label: str
    unit: str
    size: tuple[int, int] = SMALL


def over_joints(drawn: Drawn, joint_names: Sequence[str]) -> list[Plot]:
    """One plot a joint: the turn of this joint alone that would explain the error, over its angle."""
    plots = []
    for i, name in enumerate(joint_names if drawn.joint_view_urad else ()):
        plots.append(_joint_plot(drawn, i, _angle(drawn, i), f"overjoint{i + 1}", SMALL, name))
    return plots


def of_finding(drawn: Drawn, diagnosis: Diagnosis, finding: Finding, number: int) -> list[Plot]:
    """One plot for each joint of a finding, over what its cause depends on."""
    plots = []
    for joint in finding.joints if drawn.joint_view_urad else ():
        identity = f"finding{number}joint{joint}"
        if finding.effect == "axis_wobble":
            plots.extend(_along_axis_plots(drawn, diagnosis, joint - 1, identity))
        else:
            axis = _driver(drawn, diagnosis, finding.effect, joint - 1)
            plots.append(_joint_plot(drawn, joint - 1, axis, identity, LARGE))
    return plots


def over_time(drawn: Drawn) -> list[Plot]:
    """One plot for each component of the error, over the clock or over the order of measurement."""
    return _component_plots(drawn, _time(drawn), "overtime")


def over_temperature(drawn: Drawn) -> list[Plot]:
    """The same over temperature; nothing where it was not recorded."""
    if drawn.temperature_c is None:
        return []
    return _component_plots(drawn, Axis(drawn.temperature_c, "temperature, °C"), "overtemperature")


def _driver(drawn: Drawn, diagnosis: Diagnosis, effect: str, joint: int) -> Axis:
    """What a cause depends on most plainly."""
    if effect == "warmup_drift":
        return _time(drawn)
    measurements, kept = diagnosis.measurements, drawn.row - 1
    if effect == "backlash" and measurements.approach is not None:
        spread = np.random.default_rng(0).uniform(-0.25, 0.25, len(kept))
        return Axis(measurements.approach[kept, joint] + spread, "direction of arrival (spread out to be seen)")
    if effect in ("joint_compliance", "backlash"):
        payload = np.broadcast_to(measurements.extra_payload_kg, (len(measurements),))[kept]
        torque = diagnosis.calibration.robot.robot().gravity_torque(drawn.q_rad, payload)
        return Axis(torque[:, joint], "gravity torque about the joint, N m")
    return _angle(drawn, joint)


def _angle(drawn: Drawn, joint: int) -> Axis:
    return Axis(np.degrees(drawn.q_rad[:, joint]), ANGLE, FINE_BINS)


def _time(drawn: Drawn) -> Axis:
    if drawn.time_s is None:
        return Axis(drawn.row.astype(float), "row of the data, in the order of measurement")
    since = drawn.time_s - drawn.time_s.min(initial=np.inf)
    for unit, seconds in (("h", 3600.0), ("min", 60.0)):
        if since.max(initial=0.0) > 3 * seconds:
            return Axis(since / seconds, f"time since the first reading, {unit}")
    return Axis(since, "time since the first reading, s")


def _joint_plot(
    drawn: Drawn, joint: int, axis: Axis, identity: str, size: tuple[int, int], joint_name: str = ""
) -> Plot:
    values = {stage: drawn.joint_view_urad[stage][:, joint] for stage in drawn.stages}
    prefix = f"{joint_name}: " if joint_name else ""
    if not any(np.isfinite(y).any() for y in values.values()):
        return Plot("", f"{prefix}joint {joint + 1} moves the probe too little for its error to be seen")
    return _scatter(drawn, axis, values, Frame(identity, f"Joint {joint + 1}", "joint error", "µrad", size), prefix)


def _along_axis_plots(drawn: Drawn, diagnosis: Diagnosis, joint: int, identity: str) -> list[Plot]:
    """A wobbling axis does not turn its joint: the error along and across the axis shows it."""
    robot = diagnosis.calibration.robot.robot()
    X_BA, _ = axis_and_flange_poses(robot, np.zeros(4 * robot.num_joints + 12), drawn.q_rad)
    R_BA = X_BA[:, joint, :3, :3]
    error_A = {stage: np.einsum("kji,kj->ki", R_BA, drawn.error_B[stage][:, :3]) for stage in drawn.stages}
    plots = []
    for k, direction in enumerate(("across the axis, x", "across the axis, y", "along the axis")):
        values = {stage: error[:, k] for stage, error in error_A.items()}
        frame = Frame(f"{identity}{k}", f"Joint {joint + 1}, {direction}", "position error", "mm")
        plots.append(_scatter(drawn, _angle(drawn, joint), values, frame))
    return plots


def _component_plots(drawn: Drawn, axis: Axis, identity: str) -> list[Plot]:
    plots = []
    width = drawn.error_B[drawn.stages[0]].shape[1] if drawn.stages else 0
    for k in range(width):
        title, unit = (("Position, along", "mm"), ("Orientation, about", "mrad"))[k // 3]
        values = {stage: drawn.error_B[stage][:, k] for stage in drawn.stages}
        plots.append(_scatter(drawn, axis, values, Frame(f"{identity}{k}", f"{title} {'xyz'[k % 3]}", "error", unit)))
    return plots


def _scatter(drawn: Drawn, axis: Axis, values: dict[str, Array], frame: Frame, prefix: str = "") -> Plot:
    """Points ``(K,)`` of each stage over an axis, with their trend."""
    y_label = f"{frame.y_label}, {frame.unit}"
    figure, axes = new_axes(*frame.size, x_label=axis.label, y_label=y_label, title=frame.title)
    limit = symmetric_limit(*values.values())
    axes.set_ylim(-limit, limit)
    if len(axis.values):
        lowest, highest = float(axis.values.min()), float(axis.values.max())
        margin = 0.02 * (highest - lowest) or 0.5
        axes.set_xlim(lowest - margin, highest + margin)
        if axis.label == ANGLE:
            mark_angles(axes, lowest, highest)
    rows = drawn_rows(len(axis.values))
    as_picture = len(rows) * len(values) > MOST_VECTOR_POINTS
    beyond = 0
    for stage, y in values.items():
        known = np.isfinite(y)
        beyond += int(np.sum(np.abs(y[known]) > limit))
        shown = rows[known[rows]]
        at_edge = np.clip(y[shown], -limit, limit)
        colour = PALE_COLOURS[stage]
        draw_points(axes, axis.values[shown], at_edge, drawn.unseen[shown], colour, as_picture=as_picture)
    axes.axhline(0.0, color="#8a949e", linewidth=0.8, zorder=2.5)
    for stage, y in values.items():
        known = np.isfinite(y)
        trend = moving_median(axis.values[known], y[known], axis.bins)
        axes.plot(*trend, color=COLOURS[stage], linewidth=1.5, zorder=3)
    judged, what = drawn.judged
    sizes = [significant(median_size(y, judged), 2) for y in values.values()]
    caption = f"{prefix}half of the {what} within {' → '.join(sizes)} {frame.unit}"
    caption += f"; {counted(beyond, 'point')} beyond the axis" if beyond else ""
    named = " and ".join(STAGE_NAMES[stage] for stage in values)
    label = f"{frame.title}, {y_label} over {axis.label}, {named}. {caption}"
    return Plot(write_svg(figure, label, frame.identity), caption)
