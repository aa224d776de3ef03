"""What a laser tracker sees: a reflector that faces it, near enough and far enough."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array

AXES = {f"{sign}{axis}": s * np.eye(3)[k] for sign, s in (("", 1.0), ("-", -1.0)) for k, axis in enumerate("xyz")}


@dataclass(frozen=True, eq=False)
class Sight:
    """A tracker T in the world W and the cone in which a reflector E returns its beam.

    Attributes:
        p_WT: ``(3,)``, m.
        range_m: nearest and farthest distance.
        acceptance_rad: half angle of the cone about the reflector's axis; pi for a reflector that is seen from
            everywhere.
        axis_E: ``(3,)`` unit vector out of the reflector.
        view_rad: half angle of the cone that the tracker sees; pi for one that turns its head anywhere.
        aim_W: ``(3,)`` unit vector along the axis of that cone.
    """

    p_WT: Array
    range_m: tuple[float, float]
    acceptance_rad: float
    axis_E: Array
    view_rad: float = math.pi
    aim_W: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))

    def sees(self, X_WE: Array) -> Array:
        """``(N,)`` whether a reflector at poses ``(N, 4, 4)`` is within range and faces the tracker."""
        beam = self.p_WT - X_WE[:, :3, 3]
        distance = np.linalg.norm(beam, axis=1)
        facing = np.einsum("nij,j,ni->n", X_WE[:, :3, :3], self.axis_E, beam)
        near_enough = (distance >= self.range_m[0]) & (distance <= self.range_m[1])
        in_view = -beam @ self.aim_W >= distance * math.cos(self.view_rad) if self.view_rad < math.pi else True
        return near_enough & in_view & (facing >= distance * math.cos(self.acceptance_rad))


def stated_sight(
    tracker: str | None, range_m: str, acceptance_deg: float, axis: str, aim: str | None = None, view_deg: float = 180.0
) -> Sight | None:
    """A tracker as stated on the command line; None where none was.

    Args:
        tracker: ``x,y,z`` in the world, m.
        range_m: ``nearest,farthest``, m.
        acceptance_deg: half angle of the reflector's cone.
        axis: of the reflector's frame: x, y, z, -x, -y or -z.
        aim: ``x,y,z`` of a point in the world, m, at which a tracker that does not turn looks.
        view_deg: half angle of what that sees.

    Raises:
        InputError: something cannot be read, or makes no sense.
    """
    if tracker is None:
        return None
    place, span = _numbers(tracker), _numbers(range_m)
    if place is None or len(place) != 3:
        raise InputError("cannot read the place of the tracker", expected="x,y,z in the world, m", found=tracker)
    if span is None or len(span) != 2 or not 0.0 <= span[0] < span[1]:
        raise InputError("cannot read the range of the tracker", expected="nearest,farthest in m", found=range_m)
    for angle in (acceptance_deg, view_deg):
        if not 0.0 < angle <= 180.0:
            found = f"{angle:g}"
            raise InputError("no cone has this half angle", expected="more than 0, at most 180 degrees", found=found)
    if axis not in AXES:
        raise InputError("unknown axis of the reflector", expected="one of " + ", ".join(AXES), found=axis)
    p_WT = np.array(place)
    sight = Sight(p_WT, (span[0], span[1]), math.radians(acceptance_deg), AXES[axis])
    if aim is None and view_deg == 180.0:
        return sight
    point = _numbers(aim or "")
    if point is None or len(point) != 3 or np.allclose(point, place):
        expected = "with --view-deg, --aim x,y,z: a point in the world, m, beside the tracker"
        raise InputError("nobody says where the tracker looks", expected=expected, found=aim)
    beam = np.array(point) - p_WT
    return replace(sight, view_rad=math.radians(view_deg), aim_W=beam / np.linalg.norm(beam))


def _numbers(text: str) -> list[float] | None:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        return None
    return numbers if all(math.isfinite(number) for number in numbers) else None
