"""What ``CalibrationPlugin.preview`` gives back of a picture in a host's own Meshcat."""

from __future__ import annotations

from dataclasses import dataclass

from truepath.host.live_view import LiveView
from truepath.iso9283 import ErrorStatistics
from truepath.lie import Array


@dataclass(frozen=True)
class PathsShown:
    """What is on screen.

    Attributes:
        programmed, real, corrected: ``(K, 3)`` tool points in the world, m: meant; today; with the correction. As
            drawn: the distances of the latter two from the first are ``magnification`` times as long as they are.
        magnification: factor by which errors are drawn.
        real_mm, corrected_mm: the distances as they are, at the waypoints.
        waypoint: at which the arms are, counted from 1.
        view: to move the arms, to show and hide parts, to take it all away.
    """

    programmed: Array
    real: Array
    corrected: Array
    magnification: float
    real_mm: ErrorStatistics
    corrected_mm: ErrorStatistics
    waypoint: int
    view: LiveView

    @classmethod
    def of(cls, view: LiveView, waypoint: int) -> PathsShown:
        """Of a view as it is."""
        course, factor = view.course, view.magnification
        real, corrected = (course.drawn(points, factor) for points in (course.real, course.corrected))
        return cls(course.meant, real, corrected, factor, *course.at_waypoints(), waypoint, view)
