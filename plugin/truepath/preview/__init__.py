"""The preview: one HTML page that shows what a correction does, for people. It opens anywhere, without a network.

``shown`` says of what, ``toolpaths`` and ``keyframes`` compute what is to be seen, ``arm`` reads the robot's shapes,
``scene`` says it in the language of meshcat, ``page`` wraps it up. No server is started and nothing of Drake is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from truepath.calibration import Calibration
from truepath.errors import InputError
from truepath.expected import ExpectedError
from truepath.files import write_atomically
from truepath.iso9283 import ErrorStatistics
from truepath.lie import Array
from truepath.networks_along import NetworksAlong
from truepath.preview.arm import read_arm
from truepath.preview.colours import scale_end_mm
from truepath.preview.covered import covered_surface
from truepath.preview.keyframes import animate
from truepath.preview.page import PageText, render
from truepath.preview.scene import Drawing, record_scene
from truepath.preview.shown import HostTool, ShownPath, require_joints
from truepath.preview.toolpaths import FinePaths, Magnification, magnification_of

if TYPE_CHECKING:
    from truepath.controller import Controller
    from truepath.rewriting.rewrite import RewrittenProgram

__all__ = ["HostTool", "Magnification", "PreviewSummary", "write_preview", "write_program_preview", "write_shown"]


@dataclass(frozen=True)
class PreviewSummary:
    """What the page says, for whoever wrote it.

    Attributes:
        output: the page.
        waypoints, outside_region: how many there are, and how many the calibration data did not reach.
        uncorrected_mm, corrected_mm: distance of the real tool point from the programmed one at the
            waypoints, as the calibration predicts it. The latter is how exactly the solver meets the calibrated
            model; what the robot will do is ``expected``.
        expected: what remains to be expected on the robot with the correction.
        magnification: factor by which errors are drawn.
        key_frames: of the animation; 1 where nothing moves.
        missing_meshes: files that the robot model names and that could not be read; they are not drawn.
        networks: what they say at the waypoints; None where the calibration has none.
        remarks: how many things there are to look at.
    """

    output: Path
    waypoints: int
    outside_region: int
    uncorrected_mm: ErrorStatistics
    corrected_mm: ErrorStatistics
    expected: ExpectedError
    magnification: float
    key_frames: int
    missing_meshes: tuple[str, ...]
    networks: NetworksAlong | None = None
    remarks: int = 0


def write_preview(
    output: str | Path,
    calibration: Calibration,
    q_programmed: Array,
    q_corrected: Array,
    *,
    robot_source: str | Path,
    magnification: Magnification = 50.0,
    title: str = "Path preview",
    labels: Sequence[str] | None = None,
    tool: HostTool | None = None,
) -> PreviewSummary:
    """Writes a self-contained page with the arm, the programmed path and the path of the real robot.

    Args:
        output: the page, replaced as a whole.
        calibration: the robot as it is.
        q_programmed: ``(N, n)`` joints of the program, rad; what they reach in nominal kinematics is what it means.
        q_corrected: ``(N, n)`` joints that the real robot is to be sent to, rad.
        robot_source: built-in name, URDF or Drake directives: where the shapes of the arm come from.
        magnification: factor by which errors are drawn, or "auto" for a round one that makes them visible.
        title: headline of the page; any text.
        labels: N names of the waypoints, shown while the arm passes them.
        tool: whose paths are shown; None: the tool point of the calibration.

    Raises:
        InputError: joints, labels or magnification that make no sense, a model that cannot be read or that
            is not that of the calibration, or a page that cannot be written.
    """
    q_programmed, q_corrected = np.asarray(q_programmed, float), np.asarray(q_corrected, float)
    require_joints(q_programmed, q_corrected, calibration.model.robot.num_joints)
    if labels is not None and len(labels) != len(q_programmed):
        raise InputError(
            "labels and waypoints differ in number", expected=str(len(q_programmed)), found=str(len(labels))
        )
    shown = ShownPath.of_joints(q_programmed, q_corrected, labels)
    return write_shown(output, calibration, shown, robot_source, magnification, title, tool)


def write_program_preview(
    output: str | Path,
    calibration: Calibration,
    rewritten: RewrittenProgram,
    controller: Controller,
    *,
    robot_source: str | Path,
    magnification: Magnification = 50.0,
    title: str = "Path preview",
    text: str | None = None,
    tool: HostTool | None = None,
    report: str | None = None,
) -> PreviewSummary:
    """The same for a corrected program: with its lines, its tool, and what the guards say.

    Args:
        rewritten: the program; targets that cannot be resolved are not shown.
        controller: of the robot, as it was rewritten for.
        text: of the program as it was, whose lines are shown along with the waypoints; None: only their numbers.
        tool: whose paths are shown if the program states none; None: the tool point of the calibration.
        report: name of the report on this calibration, beside the page, to which it links.

    Raises:
        InputError: there is no target, or as ``write_preview``.
    """
    if not len(rewritten.plan):
        raise InputError("there is nothing to show", file=rewritten.file, expected="targets that can be resolved")
    shown = ShownPath.of_program(rewritten, controller, text)
    return write_shown(output, calibration, shown, robot_source, magnification, title, tool, report)


def write_shown(
    output: str | Path,
    calibration: Calibration,
    shown: ShownPath,
    robot_source: str | Path,
    magnification: Magnification,
    title: str,
    tool: HostTool | None,
    report: str | None = None,
) -> PreviewSummary:
    """The same for a path with all that is to be said of it; arguments as above."""
    output = Path(output)
    model, region = calibration.model, calibration.region.region()
    arm = read_arm(robot_source, model.robot, calibration.robot.name)
    outside = shown.outside(region)
    networks = None
    if model.residual is not None:
        networks = NetworksAlong.of(model.residual, shown.q_corrected[shown.waypoint])
    p_FT, tool_name = model.X_FE[:3, 3], "the tool point of the calibration"
    if shown.X_FT is not None:
        p_FT, tool_name = shown.X_FT[:3, 3], "the tool that the program states"
    elif tool is not None:
        shown = replace(shown, X_FT=tool.as_it_is(model))
        p_FT, tool_name = tool.X_FT[:3, 3], tool.name
    fine = FinePaths.of(model, shown, outside)
    at_waypoints = fine.paths.at(fine.waypoint)
    errors = at_waypoints.errors_mm()
    uncorrected, corrected = (ErrorStatistics.of(each) for each in errors)
    factor = magnification_of(at_waypoints, magnification)
    frames = animate(model, fine, p_FT, factor)
    covered = covered_surface(region, model.robot)
    scale_mm = scale_end_mm(fine.paths.errors_mm()[0])
    recorded = record_scene(Drawing(arm, model, fine, frames, p_FT, factor, scale_mm, covered))
    remarks = (*shown.remarks, *shown.stretches_outside(region))
    outside_count = int(outside[shown.waypoint].sum())
    expected = ExpectedError.of(calibration, len(shown.waypoint), outside_count)
    text = PageText(
        title=title,
        robot=calibration.robot.name,
        calibrated_utc=calibration.created_utc,
        waypoints=len(shown.waypoint),
        outside=outside_count,
        magnification=factor,
        scale_mm=scale_mm,
        tool=tool_name,
        base_mm=1e3 * model.robot.X_WB[:3, 3],
        uncorrected=uncorrected,
        corrected=corrected,
        expected=expected,
        missing_meshes=arm.missing_meshes,
        networks=networks,
        remarks=remarks,
        has_region=covered is not None,
        report=report,
    )
    write_atomically(output, render(text, shown, outside[shown.waypoint], recorded, frames))
    return PreviewSummary(
        output=output,
        waypoints=text.waypoints,
        outside_region=text.outside,
        uncorrected_mm=uncorrected,
        corrected_mm=corrected,
        expected=expected,
        magnification=factor,
        key_frames=len(frames.time_s),
        missing_meshes=arm.missing_meshes,
        networks=networks,
        remarks=len(remarks),
    )
