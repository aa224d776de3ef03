"""What is to be seen, in the language of meshcat."""

from __future__ import annotations

from dataclasses import dataclass

import meshcat.geometry as mg
import numpy as np
from meshcat.path import Path as ScenePath
from meshcat.visualizer import Visualizer

from truepath import lie
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.networks_along import NetworksAlong
from truepath.preview.arm import Arm
from truepath.preview.colours import (
    BAND_OPACITY,
    CORRECTED,
    FADED,
    OUTSIDE,
    PROGRAMMED,
    REGION,
    UNCORRECTED,
    error_colours,
    rgb,
    unit_rgb,
)
from truepath.preview.geometry import arrows
from truepath.preview.keyframes import KeyFrames
from truepath.preview.recorded import RecordedScene
from truepath.preview.stage import FAR_WALLS_ONLY, Stage, joint_transforms, occupied_points
from truepath.preview.toolpaths import FinePaths

__all__ = ["CORRECTED", "PROGRAMMED", "UNCORRECTED", "Drawing", "record_scene", "worth_a_mark"]

MOST_ERROR_ARROWS, MOST_TOOL_FRAMES = 66, 24
VIEW_POSTURES, VIEW_LINE_POINTS = 60, 300
BELOW_BASE = 0.05  # of the scene's size: what reaches further down than the base has the grid below it
VIEW_AZIMUTH_RAD, VIEW_ELEVATION_RAD = np.radians(-55.0), np.radians(24.0)  # azimuth from where the path lies

ROOT = "truepath"
ARM, GHOST, ERROR_ARROWS = "arm_corrected", "arm_uncorrected", "error_arrows"
PATH_PROGRAMMED, PATH_UNCORRECTED, PATH_CORRECTED = "path_programmed", "path_uncorrected", "path_corrected"
PATH_FADED, TOOL_FRAMES, REGION_COVERED = "path_faded", "tool_frames", "region_covered"
LINE, BAND, SLEEVE_LEAST, SLEEVE_MOST = 0.002, 2.8, 4.0, 6.5  # half widths: of the scene's size; in those of a line


@dataclass(frozen=True, eq=False)
class Drawing:
    """What a scene is made of.

    Attributes:
        arm: shapes of the robot.
        model: the calibrated robot.
        fine: the paths, in true size.
        frames: the animation.
        p_FT: ``(3,)`` the tool point in the flange, m.
        magnification: factor by which errors are drawn.
        scale_mm: error at the end of the colour scale.
        covered: vertices and faces around what the calibration covers; None for nothing.
    """

    arm: Arm
    model: CalibratedModel
    fine: FinePaths
    frames: KeyFrames
    p_FT: Array
    magnification: float
    scale_mm: float
    covered: tuple[Array, Array] | None


def record_scene(drawing: Drawing) -> RecordedScene:
    """Everything that is to be seen, in the world, with the robot's base where it really is."""
    arm, fine, frames, model = drawing.arm, drawing.fine, drawing.frames, drawing.model
    paths = fine.paths.magnified(drawing.magnification)
    postures = np.concatenate([frames.q_corrected, frames.q_uncorrected])
    bodies = occupied_points(arm, postures[_evenly(len(postures), VIEW_POSTURES)])
    size = max(float(np.linalg.norm(bodies, axis=1).max()), 0.1)

    recorded = RecordedScene()
    stage = Stage(Visualizer.view_into(recorded, ScenePath((ROOT,))), size)
    X_WB = model.robot.X_WB @ lie.invert(model.goal_frames()[0])
    stage.root.set_transform(X_WB)
    lowest = float((np.concatenate([bodies, paths.goal]) @ X_WB[2, :3]).min())
    stage.surroundings(X_WB[:3, :3], lowest if lowest < -BELOW_BASE * size else 0.0)
    if model.residual is not None:  # before the paths: what is transparent is drawn in the order in which it came
        _draw_sleeve(stage, fine, NetworksAlong.of(model.residual, fine.q_corrected))
    _draw_paths(stage, drawing)
    _draw_marks(stage, drawing)
    stage.arm(stage.root[ARM], arm, frames.q_corrected[0], drawing.p_FT, CORRECTED)
    stage.arm(stage.root[GHOST], arm, frames.q_uncorrected[0], drawing.p_FT, UNCORRECTED, as_ghost=True)
    if drawing.covered is not None:
        stage.veil(REGION_COVERED, *drawing.covered, REGION)
        corners = drawing.covered[0]
        recorded.region_points = corners[_evenly(len(corners), VIEW_LINE_POINTS)] @ X_WB[:3, :3].T + X_WB[:3, 3]

    lines = np.concatenate([paths.goal, paths.uncorrected, paths.corrected])
    lines = lines[_evenly(len(lines), VIEW_LINE_POINTS)]
    recorded.path_points = lines @ X_WB[:3, :3].T + X_WB[:3, 3]
    recorded.arm_points = np.concatenate([bodies, lines]) @ X_WB[:3, :3].T + X_WB[:3, 3]
    recorded.view_direction = _view_direction(X_WB[:3, :3] @ paths.goal.mean(axis=0))
    at_zero = joint_transforms(arm, np.zeros(len(arm.link_transforms) - 1))
    recorded.joint_quaternions = lie.to_quaternion(at_zero[:, :3, :3])[:, [1, 2, 3, 0]]
    return recorded


def _draw_paths(stage: Stage, drawing: Drawing) -> None:
    """The three lines. The programmed one is a wide pale band, so that the corrected one shows inside it."""
    fine, paths, radius = drawing.fine, drawing.fine.paths.magnified(drawing.magnification), LINE * stage.size
    shades = np.where(fine.outside[:, None], unit_rgb(OUTSIDE), unit_rgb(PROGRAMMED))
    band = stage.shaded(opacity=BAND_OPACITY, **FAR_WALLS_ONLY)
    stage.line(PATH_PROGRAMMED, paths.goal, fine.piece, BAND * radius, band, shades)
    by_error = error_colours(fine.paths.errors_mm()[0], drawing.scale_mm)
    stage.line(PATH_UNCORRECTED, paths.uncorrected, fine.piece, 1.4 * radius, None, by_error)
    stage.line(PATH_CORRECTED, paths.corrected, fine.piece, radius, stage.bright(CORRECTED))


def _draw_sleeve(stage: Stage, fine: FinePaths, networks: NetworksAlong) -> None:
    """Around the programmed line: the wider, the more the networks are faded there; else none."""
    half_width = SLEEVE_LEAST + (SLEEVE_MOST - SLEEVE_LEAST) * (1.0 - networks.weight)
    if networks.faded.any():
        material = stage.material(mg.MeshBasicMaterial, rgb(FADED), opacity=0.75, **FAR_WALLS_ONLY)
        radius = LINE * stage.size * np.where(networks.faded, half_width, 0.0)
        stage.line(PATH_FADED, fine.paths.goal, fine.piece, radius, material)


def _draw_marks(stage: Stage, drawing: Drawing) -> None:
    """Arrows of the errors and frames of the tool, at some of the waypoints."""
    true = drawing.fine.paths.at(drawing.fine.waypoint)
    error_mm = true.errors_mm()[0]
    drawn = true.magnified(drawing.magnification)
    shown = worth_a_mark(true.goal, error_mm, MOST_ERROR_ARROWS)
    colours = error_colours(error_mm[shown], drawing.scale_mm)
    geometry = arrows(drawn.goal[shown], drawn.uncorrected[shown], 0.6 * LINE * stage.size, colours)
    if geometry is not None:
        stage.two_looks(ERROR_ARROWS, geometry)
    frames = true.X_BT_goal[worth_a_mark(true.goal, error_mm, MOST_TOOL_FRAMES)]
    stage.frames(TOOL_FRAMES, frames, 0.035 * stage.size, 0.0016 * stage.size)


def worth_a_mark(points: Array, error_mm: Array, most: int) -> Array:
    """Indices of a few waypoints ``(T, 3)`` spread evenly along the path, the first, last and worst among them."""
    travel = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    even = np.searchsorted(travel, np.linspace(0.0, travel[-1], most - 1) - 1e-12)
    few = np.arange(len(points)) if len(points) <= most else even
    return np.union1d(np.minimum(few, len(points) - 1), [0, len(points) - 1, int(np.argmax(error_mm))])


def _evenly(count: int, most: int) -> Array:
    return np.linspace(0, count - 1, min(count, most)).astype(int)


def _view_direction(path_centre: Array) -> Array:
    """From the side, so that arm and path lie beside each other, and a little from above."""
    azimuth = np.arctan2(path_centre[1], path_centre[0]) + VIEW_AZIMUTH_RAD
    level, up = np.cos(VIEW_ELEVATION_RAD), np.sin(VIEW_ELEVATION_RAD)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), up])
