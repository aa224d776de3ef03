"""What ``CalibrationPlugin.preview`` gives back of a picture in a host's own Meshcat."""

from __future__ import annotations

from dataclasses import dataclass

from truepath.host.live_view import LiveView
from truepath.iso9283 import ErrorStatistics
from truepath.lie import Array
from truepath.preview.figures import in_mm


@dataclass(frozen=True)
class PathsShown:
    """What is on screen.

    Attributes:
        programmed, real, corrected: ``(K, 3)`` tool points in the world, m: meant; today; with the correction. As
            drawn: the distances of the latter two from the first are ``magnification`` times as long as they are.
        magnification: factor by which errors are drawn.
        real_mm, corrected_mm: the distances as they are, at the waypoints.
        waypoint: at which the arms are, counted from 1.
        warnings: what is to be looked at, in plain sentences.
        looked_in: where collisions were looked for; None: nowhere.
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
    warnings: tuple[str, ...] = ()
    looked_in: str | None = None

    def __repr__(self) -> str:
        real, corrected = (in_mm(errors.mean) for errors in (self.real_mm, self.corrected_mm))
        return (
            f"<PathsShown {len(self.view.course.shown.waypoint)} waypoints, predicted mean error {real} mm today, "
            f"{corrected} mm corrected; {len(self.warnings)} warnings, at waypoint {self.waypoint}, errors drawn "
            f"{self.magnification:g} times as long>"
        )

    @classmethod
    def of(cls, view: LiveView, waypoint: int) -> PathsShown:
        """Of a view as it is."""
        course, factor = view.course, view.magnification
        real, corrected = (course.drawn(points, factor) for points in (course.real, course.corrected))
        warnings = tuple(each.text for each in course.remarks)
        errors = course.at_waypoints()
        return cls(course.meant, real, corrected, factor, *errors, waypoint, view, warnings, course.shown.looked_in)
