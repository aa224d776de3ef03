"""Paths in a host's own Meshcat, in its world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from truepath.host.placed_robot import PlacedRobot
from truepath.iso9283 import ErrorStatistics
from truepath.lie import Array
from truepath.preview.scene import CORRECTED, PROGRAMMED, UNCORRECTED
from truepath.preview.toolpaths import fine_positions, interpolate

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

PREFIX = "/truepath"
LINE_WIDTH, POINT_SIZE_M = 3.0, 0.01


@dataclass(frozen=True)
class PathsShown:
    """What is on screen.

    Attributes:
        programmed, real, corrected: ``(K, 3)`` tool points in the world, m: meant; today; with the correction. As
            drawn: the distances of the latter two from the first are ``magnification`` times as long as they are.
        magnification: factor by which errors are drawn.
        real_mm, corrected_mm: the distances as they are, at the waypoints.
    """

    programmed: Array
    real: Array
    corrected: Array
    magnification: float
    real_mm: ErrorStatistics
    corrected_mm: ErrorStatistics


def show_paths(
    meshcat: Meshcat, robot: PlacedRobot, q_programmed: Array, q_corrected: Array, magnification: float
) -> PathsShown:
    """Draws three lines below ``/truepath``: ``programmed``, ``real``, ``corrected``; earlier ones go.

    Args:
        q_programmed, q_corrected: ``(N, n)``; in between the joints are taken to move linearly.
    """
    errors = [
        ErrorStatistics.of(1e3 * np.linalg.norm((poses - robot.programmed_tool_poses(q_programmed))[:, :3, 3], axis=1))
        for poses in (robot.tool_poses(q_programmed), robot.tool_poses(q_corrected))
    ]
    at = fine_positions(q_programmed)
    programmed = interpolate(q_programmed, at)
    meant = robot.programmed_tool_poses(programmed)[:, :3, 3]
    real, corrected = (robot.tool_poses(q)[:, :3, 3] for q in (programmed, interpolate(q_corrected, at)))
    real, corrected = (meant + magnification * (points - meant) for points in (real, corrected))
    for name, points, colour in (
        ("programmed", meant, PROGRAMMED),
        ("real", real, UNCORRECTED),
        ("corrected", corrected, CORRECTED),
    ):
        _draw(meshcat, f"{PREFIX}/{name}", points, colour)
    return PathsShown(meant, real, corrected, magnification, *errors)


def _draw(meshcat: Meshcat, path: str, points: Array, colour: str) -> None:
    from pydrake.geometry import Rgba

    rgba = Rgba(*(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)), 1.0)
    if len(points) > 1:
        meshcat.SetLine(path, np.ascontiguousarray(points.T), LINE_WIDTH, rgba)
        return
    from pydrake.perception import BaseField, Fields, PointCloud

    cloud = PointCloud(1, Fields(BaseField.kXYZs))
    cloud.mutable_xyzs()[:] = points.T
    meshcat.SetObject(path, cloud, POINT_SIZE_M, rgba)
