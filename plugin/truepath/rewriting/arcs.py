"""Arcs through a point to an end, as ``movec`` has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath.guards import Finding
from truepath.lie import Array
from truepath.programs.motions import Kind
from truepath.rewriting.plan import Plan, with_tool_of

FLAT = 1e-6  # sine of the angle between two chords, below which three points are on a line


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle in space: centre ``(3,)``, radius, unit axis ``(3,)``."""

    centre: Array
    radius_m: float
    axis: Array

    def distance(self, points: Array) -> Array:
        """``(K,)`` distances of points ``(K, 3)`` from it."""
        away = points - self.centre
        height = away @ self.axis
        radial = np.linalg.norm(away - height[:, None] * self.axis, axis=1) - self.radius_m
        return np.hypot(radial, height)


@dataclass(frozen=True, eq=False)
class Arc:
    """Part of a circle.

    Attributes:
        start: index of the target where it starts.
        through: index of the target that it passes.
        circle: that it lies on.
        radius: ``(3,)`` from the centre to its first point.
        angle_rad: by which it turns about the axis, positive.
    """

    start: int
    through: int
    circle: Circle
    radius: Array
    angle_rad: float

    @property
    def length_m(self) -> float:
        return self.circle.radius_m * self.angle_rad

    def points(self, share: Array) -> Array:
        """``(K, 3)`` at shares ``(K,)`` of it."""
        angle = (share * self.angle_rad)[:, None]
        side = np.cross(self.circle.axis, self.radius)
        return self.circle.centre + np.cos(angle) * self.radius + np.sin(angle) * side


def circle_through(one: Array, two: Array, three: Array) -> Circle | None:
    """The circle through three points ``(3,)``; None if they are on a line. Its axis is right-handed along them."""
    a, b = two - one, three - one
    normal = np.cross(a, b)
    size = float(np.linalg.norm(normal))
    if size <= FLAT * np.linalg.norm(a) * np.linalg.norm(b) or size == 0.0:
        return None
    to_centre = np.cross(float(a @ a) * b - float(b @ b) * a, normal) / (2 * size**2)
    return Circle(one + to_centre, float(np.linalg.norm(to_centre)), normal / size)


def arc_through(one: Array, two: Array, three: Array, start: int = -1, through: int = -1) -> Arc | None:
    """The arc from one by two to three."""
    circle = circle_through(one, two, three)
    if circle is None:
        return None
    radius, last = one - circle.centre, three - circle.centre
    angle = float(np.arctan2(np.cross(radius, last) @ circle.axis, radius @ last)) % (2 * np.pi)
    return Arc(start, through, circle, radius, angle)


def arcs_of(plan: Plan, X_CT: Array) -> tuple[dict[int, Arc], list[Finding]]:
    """Arcs of a plan by their end target, and a warning for those that are none."""
    motions = plan.motions
    arcs: dict[int, Arc] = {}
    findings = []
    for end in np.flatnonzero(motions.kind == Kind.ARC).tolist():
        through = int(motions.previous[end])
        if through < 0 or motions.kind[through] != Kind.THROUGH or motions.previous[through] < 0:
            continue
        start = int(motions.previous[through])
        begin = with_tool_of(motions, X_CT, np.array([start]), np.array([end]))
        one, two, three = begin[0, :3, 3], X_CT[through, :3, 3], X_CT[end, :3, 3]
        arc = arc_through(one, two, three, start, through)
        if arc is None:
            message = "its start, middle and end are on a line: no arc, nothing was added on the way"
            findings.append(Finding("warning", "path", int(motions.line[end]), message))
        else:
            arcs[end] = arc
    return arcs, findings
