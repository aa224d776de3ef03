"""Paths in a host's own Meshcat, in its world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from truepath.host.course import Course
from truepath.host.lines_drawn import draw_line
from truepath.host.placed_robot import PlacedRobot
from truepath.iso9283 import ErrorStatistics
from truepath.lie import Array
from truepath.preview.colours import CORRECTED, PROGRAMMED, UNCORRECTED, unit_rgb
from truepath.preview.shown import ShownPath

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

PREFIX = "/truepath"
LINE_RADIUS_M, POINT_RADIUS_M = 0.002, 0.006


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


def show_paths(meshcat: Meshcat, robot: PlacedRobot, shown: ShownPath, magnification: float) -> PathsShown:
    """Draws three lines below ``/truepath``: ``programmed``, ``real``, ``corrected``; earlier ones go."""
    course = Course.of(robot, shown)
    at = course.fine.waypoint
    real, corrected = (course.drawn(points, magnification) for points in (course.real, course.corrected))
    for name, points, colour in (
        ("programmed", course.meant, PROGRAMMED),
        ("real", real, UNCORRECTED),
        ("corrected", corrected, CORRECTED),
    ):
        _draw(meshcat, f"{PREFIX}/{name}", points, colour, course.fine.piece)
    errors = (ErrorStatistics.of(errors[at]) for errors in (course.real_mm, course.corrected_mm))
    return PathsShown(course.meant, real, corrected, magnification, *errors)


def _draw(meshcat: Meshcat, path: str, points: Array, colour: str, piece: Array) -> None:
    meshcat.Delete(path)
    if draw_line(meshcat, path, points, LINE_RADIUS_M, unit_rgb(colour), piece):
        return
    from pydrake.geometry import Rgba, Sphere
    from pydrake.math import RigidTransform

    centre = f"{path}/point"
    meshcat.SetObject(centre, Sphere(POINT_RADIUS_M), Rgba(*unit_rgb(colour), 1.0))
    meshcat.SetTransform(centre, RigidTransform(points[0]))
