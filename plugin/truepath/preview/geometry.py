"""Triangles and poses of simple bodies, as meshcat geometries."""

from __future__ import annotations

import meshcat.geometry as mg
import numpy as np

from truepath import lie
from truepath.lie import Array

Y_TO_Z = lie.make_pose(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))  # meshcat's cylinders stand along y
COINCIDENT_M = 1e-7


def rod(start: Array, end: Array, radius_m: float) -> tuple[mg.Cylinder, Array]:
    """A cylinder between two points ``(3,)`` and its pose ``(4, 4)``."""
    along = end - start
    length = float(np.linalg.norm(along))
    z = along / length
    helper = np.eye(3)[np.argmin(np.abs(z))]
    x = np.cross(helper, z) / np.linalg.norm(np.cross(helper, z))
    X = lie.make_pose(np.stack([x, np.cross(z, x), z], axis=1), (start + end) / 2)
    return mg.Cylinder(length, radius_m), X @ Y_TO_Z


def tube(
    points: Array, radius_m: float | Array, colours: Array | None = None, sides: int = 6
) -> mg.TriangularMeshGeometry | None:
    """A line that can be seen: a tube along the points.

    Args:
        points: ``(K, 3)``; neighbours that coincide count once.
        radius_m: half its width; ``(K,)`` if it varies: where it is zero there is nothing to see.
        colours: ``(K, 3)`` red, green, blue from 0 to 1.

    Returns:
        None where all points coincide.
    """
    keep = np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=1) > COINCIDENT_M)
    radius = np.broadcast_to(radius_m, len(points))[keep]
    points = points[keep]
    K = len(points)
    if K < 2:
        return None
    angle = np.arange(sides) * 2 * np.pi / sides
    normals = _parallel_normals(points)
    binormals = np.cross(_tangents(points), normals)
    ring = np.cos(angle)[:, None] * normals[:, None] + np.sin(angle)[:, None] * binormals[:, None]
    vertices = (points[:, None] + radius[:, None, None] * ring).reshape(-1, 3)
    a = np.arange((K - 1) * sides)
    b = a - a % sides + (a + 1) % sides
    walls = np.concatenate([np.stack([a, b, a + sides], axis=1), np.stack([b, b + sides, a + sides], axis=1)])
    fan = np.arange(1, sides - 1)
    start = np.stack([np.zeros_like(fan), fan + 1, fan], axis=1)
    end = np.stack([np.zeros_like(fan), fan, fan + 1], axis=1) + (K - 1) * sides
    faces = np.concatenate([walls, start, end])
    per_vertex = None if colours is None else np.repeat(colours[keep], sides, axis=0)
    return mg.TriangularMeshGeometry(vertices, faces, per_vertex)


def _tangents(points: Array) -> Array:
    """``(K, 3)`` unit directions; at a corner the one that halves it, at a reversal the one before it."""
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    both = np.concatenate([steps[:1], steps[:-1] + steps[1:], steps[-1:]])
    length = np.linalg.norm(both, axis=1, keepdims=True)
    before = np.concatenate([steps[:1], steps])
    return np.where(length > 1e-3, both / np.maximum(length, 1e-12), before)


def _parallel_normals(points: Array) -> Array:
    """``(K, 3)`` unit vectors across the line that turn with it and never about it."""
    tangents = _tangents(points)
    normals = np.empty_like(points)
    normal = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    for k, tangent in enumerate(tangents):
        across = normal - tangent * (tangent @ normal)
        if np.linalg.norm(across) < 1e-6:
            across = np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent))])
        normals[k] = normal = across / np.linalg.norm(across)
    return normals


def line_segments(starts: Array, ends: Array, material: mg.LineBasicMaterial) -> mg.LineSegments:
    """Separate thin lines from points ``(K, 3)`` to points ``(K, 3)``."""
    corners = np.stack([starts, ends], axis=1).reshape(-1, 3)
    return mg.LineSegments(mg.PointsGeometry(corners.T.astype(np.float32)), material)


def grid_lines(half_size_m: float, cell_m: float) -> tuple[Array, Array]:
    """Starts and ends ``(K, 3)`` of the lines of a square grid in z = 0 about the origin."""
    half = np.ceil(half_size_m / cell_m) * cell_m
    at = np.arange(-half, half + cell_m / 2, cell_m)
    zero, edge = np.zeros_like(at), np.full_like(at, half)
    starts = np.concatenate([np.stack([at, -edge, zero], axis=1), np.stack([-edge, at, zero], axis=1)])
    ends = np.concatenate([np.stack([at, edge, zero], axis=1), np.stack([edge, at, zero], axis=1)])
    return starts, ends
