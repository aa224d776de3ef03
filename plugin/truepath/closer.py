"""Clearances before and after a correction, compared: where bodies come closer, and where they collide all along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from truepath.clearance import Clearances
from truepath.guards import Finding
from truepath.lie import Array

NEAR_M = 0.010
CLOSER_M = 0.001
TOUCHING_M = 1e-4  # what lies on something else does not collide with it; no clearance is known better


@dataclass(frozen=True)
class Closer:
    """A waypoint at which a correction takes two bodies closer to each other.

    Attributes:
        index: of the waypoint.
        bodies: their names.
        before_m, after_m: signed distances; infinite beyond the range that was looked at.
        kind: "new" for a collision that the program does not mean and the robot does not have today; "meant" for one
            that the program means, by the cell as drawn; "closer" for less room.
    """

    index: int
    bodies: tuple[str, str]
    before_m: float
    after_m: float
    kind: Literal["new", "meant", "closer"]


def compare(
    before: Clearances,
    after: Clearances,
    meant: Clearances | None = None,
    *,
    closer_m: float = CLOSER_M,
    near_m: float = NEAR_M,
) -> list[Closer]:
    """Where a collision is new, or a clearance below ``near_m`` got smaller by more than ``closer_m``.

    Each pair of bodies is compared with itself, so that one which is always close hides no other.

    Args:
        before, after: along the same waypoints, with programmed and with corrected joints.
        meant: of the cell as drawn, with programmed joints. A torch that shall pass a plate by 5 mm and passes it by
            7 mm today will be closer to it, rightly: what comes no closer than it is meant to, to ``closer_m``, is
            left out, unless it collides.

    Returns:
        Ordered by waypoint. The clearances must reach to ``near_m + closer_m`` at least.
    """
    if not len(before.by_pair_m) == len(after.by_pair_m) == len((meant or after).by_pair_m):
        raise ValueError("clearances of different numbers of waypoints cannot be compared")
    known_m = min(clearances.range_m for clearances in (before, after, meant or after))
    if known_m < near_m + closer_m:
        raise ValueError(f"clearances are known up to {known_m} m, and must be up to {near_m + closer_m} m")
    found = []
    for bodies in after.bodies:
        was, now = before.of(bodies), after.of(bodies)
        plan = np.full_like(now, np.inf) if meant is None else meant.of(bodies)
        as_meant = now >= plan - closer_m
        collides = (now < -TOUCHING_M) & (was >= -TOUCHING_M)
        less = np.where(np.isfinite(now), was, 0.0) - np.where(np.isfinite(now), now, 0.0) > closer_m
        closer = less & (now < near_m) & ~as_meant
        for k in np.flatnonzero(collides | closer):
            kind: Literal["new", "meant", "closer"] = "closer"
            if collides[k]:
                kind = "meant" if as_meant[k] and plan[k] < -TOUCHING_M else "new"
            found.append(Closer(int(k), bodies, float(was[k]), float(now[k]), kind))
    return sorted(found, key=lambda place: (place.index, place.after_m))


@dataclass(frozen=True)
class Driven:
    """Two bodies that collide with or without a correction: the program itself drives one into the other.

    Attributes:
        index: of the waypoint where they are deepest in each other, of those of one line.
        bodies: their names.
        depth_m: how deep after the correction, more than 0.
    """

    index: int
    bodies: tuple[str, str]
    depth_m: float


def collide_all_along(before: Clearances, after: Clearances, line: Array) -> list[Driven]:
    """Where bodies are in each other before and after, which ``compare`` leaves alone: no correction changes that.

    Args:
        before, after: along the same N waypoints.
        line: ``(N,)`` line of each waypoint.

    Returns:
        For each pair of bodies and each line the deepest waypoint; ordered by waypoint.
    """
    found = []
    for bodies in after.bodies:
        now = after.of(bodies)
        within = np.flatnonzero((now < -TOUCHING_M) & (before.of(bodies) < -TOUCHING_M))
        deepest_last = within[np.argsort(-now[within], kind="stable")]
        of_each_line = {int(line[k]): int(k) for k in deepest_last}
        found += [Driven(k, bodies, -float(now[k])) for k in of_each_line.values()]
    return sorted(found, key=lambda place: (place.index, -place.depth_m))


def driven_findings(places: list[Driven], line: Array) -> list[Finding]:
    """A warning for each of them.

    Args:
        places: from ``collide_all_along``.
        line: ``(N,)`` line of each waypoint.
    """
    return [
        Finding(
            "warning",
            "collision",
            int(line[place.index]),
            f"the program itself drives {place.bodies[0]} and {place.bodies[1]} {1e3 * place.depth_m:.2f} mm into each "
            "other; the correction does not change that",
            -1e3 * place.depth_m,
            0.0,
            "mm",
        )
        for place in places
    ]


def clearance_findings(
    places: list[Closer], line: Array, near_m: float = NEAR_M, driven: Sequence[Driven] = ()
) -> list[Finding]:
    """An error for each new collision, a warning for what comes closer.

    Args:
        places: from ``compare``.
        line: ``(N,)`` line of each waypoint.
        driven: from ``collide_all_along``: a path that enters a body by itself is deeper in it further on than where
            the correction lets it touch first, which is then told too.
    """
    findings = []
    deepest = {place.bodies: place for place in sorted(driven, key=lambda place: place.depth_m)}
    for place in places:
        is_new = place.kind == "new"
        what = f"{place.bodies[0]} and {place.bodies[1]}: {_in_words(place.after_m)} after the correction"
        message = f"{what}, {_in_words(place.before_m)} before"
        if place.kind == "meant":
            message += "; so does the program in the cell as drawn"
        further = deepest.get(place.bodies)
        if place.kind != "closer" and further is not None and further.depth_m > -place.after_m:
            message += f"; {1e3 * further.depth_m:.2f} mm deep at most, where the correction does not change that"
        findings.append(
            Finding(
                "error" if is_new else "warning",
                "clearance" if place.kind == "closer" else "collision",
                int(line[place.index]),
                message,
                1e3 * place.after_m,
                1e3 * near_m if place.kind == "closer" else 0.0,
                "mm",
            )
        )
    return findings


def _in_words(distance_m: float) -> str:
    if np.isinf(distance_m):
        return "far apart"
    return f"{1e3 * abs(distance_m):.2f} mm " + ("into each other" if distance_m < 0 else "apart")
