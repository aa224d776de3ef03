"""What is to be expected of the real robot after a correction: measured errors, not those of the solver.

The solver puts the calibrated model where the program wants the tool, to nanometres. On the robot there remains what
that model is off by: known from measured poses that the fit had not seen, and only where such poses reach.
"""

from __future__ import annotations

from dataclasses import dataclass

from truepath.calibration import Calibration
from truepath.calibration_parts import StatisticsPart

NOT_KNOWN = "not known"


@dataclass(frozen=True)
class ExpectedError:
    """Of a corrected path.

    Attributes:
        heldout_mm: errors of the calibrated model on poses that the fit had not seen; None where none were held back.
        poses: number of these.
        waypoints, outside: how many there are, and how many lie outside of the calibrated region: there nobody knows.
    """

    heldout_mm: StatisticsPart | None
    poses: int
    waypoints: int
    outside: int

    @classmethod
    def of(cls, calibration: Calibration, waypoints: int, outside: int) -> ExpectedError:
        held_out = calibration.heldout
        if held_out is None:
            return cls(None, 0, waypoints, outside)
        return cls(held_out.calibrated.position_mm, held_out.poses, waypoints, outside)

    @property
    def known_mm(self) -> StatisticsPart | None:
        """The errors, if they hold for any of the waypoints."""
        return self.heldout_mm if self.outside < self.waypoints else None

    @property
    def where_unknown(self) -> str:
        """At how many of the waypoints nobody knows; empty if at none of them, or at all."""
        return f"{NOT_KNOWN} at {self.outside} of {self.waypoints}" if 0 < self.outside < self.waypoints else ""

    @property
    def source(self) -> str:
        """Where the numbers are from, or why there are none."""
        if self.heldout_mm is None:
            return f"{NOT_KNOWN}, since the calibration was made of too few poses to hold any back"
        if self.known_mm is None:
            return f"{NOT_KNOWN}, since no waypoint lies within the calibrated region"
        beyond = f"; {self.where_unknown} waypoints: outside the calibrated region" if self.outside else ""
        errors = self.heldout_mm
        return (
            f"mean {errors.mean:.3f} mm, 95 % within {errors.p95:.3f} mm, max {errors.max:.3f} mm, as on {self.poses} "
            f"measured poses that the fit had not seen{beyond}"
        )
