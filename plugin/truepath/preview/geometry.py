"""Triangles and poses of simple bodies, as meshcat geometries."""

from __future__ import annotations

import meshcat.geometry as mg
import numpy as np

from truepath import lie
from truepath.lie import Array

Y_TO_Z = lie.make_pose(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))  # meshcat's cylinders stand along y
COINCIDENT_M = 1e-7
MANY_POINTS = 600  # tubes through more than these have fewer sides: the line turns so often that nobody can tell


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
    points: Array,
    radius_m: float | Array,
    colours: Array | None = None,
    piece: Array | None = None,
) -> mg.TriangularMeshGeometry | None:
    """A line that can be seen: a tube along the points.

    Args:
        points: ``(K, 3)``; neighbours that coincide count once.
        radius_m: half its width; ``(K,)`` if it varies: where it is zero there is nothing to see.
        colours: ``(K, 3)`` red, green, blue from 0 to 1.
        piece: ``(K,)`` number of the piece that each belongs to; pieces are not connected. None: all is one.

    Returns:
        None where all points of each piece coincide.
    """
    radius = np.broadcast_to(radius_m, len(points))
    sides = 6 if len(points) <= MANY_POINTS else 4
    cuts = np.arange(0) if piece is None else np.flatnonzero(np.diff(piece)) + 1
    all_vertices, all_faces, all_colours, count = [], [], [], 0
    for part in np.split(np.arange(len(points)), cuts):
        part = part[np.append(True, np.linalg.norm(np.diff(points[part], axis=0), axis=1) > COINCIDENT_M)]
        if len(part) > 1:
            vertices, faces = _one_tube(points[part], radius[part], sides)
            all_vertices.append(vertices)
            all_faces.append(faces + count)
            count += len(vertices)
            if colours is not None:
                all_colours.append(np.repeat(colours[part], sides, axis=0))
    if not all_vertices:
        return None
    per_vertex = np.concatenate(all_colours) if all_colours else None
    return mg.TriangularMeshGeometry(np.concatenate(all_vertices), np.concatenate(all_faces), per_vertex)


def _one_tube(points: Array, radius_m: Array, sides: int) -> tuple[Array, Array]:
    """Vertices and faces of a tube along points ``(K, 3)`` none of which coincides with the one before."""
    K = len(points)
    angle = np.arange(sides) * 2 * np.pi / sides
    normals = _parallel_normals(points)
    binormals = np.cross(_tangents(points), normals)
    ring = np.cos(angle)[:, None] * normals[:, None] + np.sin(angle)[:, None] * binormals[:, None]
    vertices = (points[:, None] + radius_m[:, None, None] * ring).reshape(-1, 3)
    fan = np.arange(1, sides - 1)
    start = np.stack([np.zeros_like(fan), fan + 1, fan], axis=1)
    end = np.stack([np.zeros_like(fan), fan, fan + 1], axis=1) + (K - 1) * sides
    return vertices, np.concatenate([_walls(K, sides), start, end])


def _walls(rings: int, sides: int) -> Array:
    """``(2 (rings - 1) sides, 3)`` faces between rings of vertices."""
    a = np.arange((rings - 1) * sides)
    b = a - a % sides + (a + 1) % sides
    return np.concatenate([np.stack([a, b, a + sides], axis=1), np.stack([b, b + sides, a + sides], axis=1)])


def _stumps(starts: Array, ends: Array, radius_start: Array, radius_end: Array, sides: int) -> tuple[Array, Array]:
    """Vertices and faces of K open rods between points ``(K, 3)``, as thick at each end as said ``(K,)``."""
    z = ends - starts
    z = z / np.maximum(np.linalg.norm(z, axis=1, keepdims=True), COINCIDENT_M)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z), axis=1)], z)
    x /= np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-12)
    angle = np.arange(sides)[:, None] * 2 * np.pi / sides
    ring = np.cos(angle) * x[:, None] + np.sin(angle) * np.cross(z, x)[:, None]
    rings = [p[:, None] + r[:, None, None] * ring for p, r in ((starts, radius_start), (ends, radius_end))]
    vertices = np.stack(rings, axis=1).reshape(-1, 3)
    first = 2 * sides * np.arange(len(starts))
    return vertices, (_walls(2, sides)[None] + first[:, None, None]).reshape(-1, 3)


def arrows(
    starts: Array, ends: Array, radius_m: float, colours: Array, sides: int = 6
) -> mg.TriangularMeshGeometry | None:
    """Arrows between points ``(K, 3)`` with colours ``(K, 3)``; None where all are too short to be seen."""
    length = np.linalg.norm(ends - starts, axis=1)
    long = length > radius_m
    if not long.any():
        return None
    starts, ends, length, colours = starts[long], ends[long], length[long], colours[long]
    head = np.minimum(6.0 * radius_m, 0.6 * length)
    neck = ends - (head / length)[:, None] * (ends - starts)
    radius, none = np.full(len(starts), radius_m), np.zeros(len(starts))
    shafts, shaft_faces = _stumps(starts, neck, radius, radius, sides)
    heads, head_faces = _stumps(neck, ends, head / 2.4, none, sides)
    per_vertex = np.repeat(np.concatenate([colours, colours]), 2 * sides, axis=0)
    faces = np.concatenate([shaft_faces, head_faces + len(shafts)])
    return mg.TriangularMeshGeometry(np.concatenate([shafts, heads]), faces, per_vertex)


def triads(
    X: Array, length_m: float, radius_m: float, axis_colours: Array, sides: int = 6
) -> mg.TriangularMeshGeometry:
    """The axes of frames ``(K, 4, 4)`` as rods, x, y and z in the colours ``(3, 3)``."""
    starts = np.repeat(X[:, :3, 3], 3, axis=0)
    ends = starts + length_m * np.swapaxes(X[:, :3, :3], 1, 2).reshape(-1, 3)
    radius = np.full(len(starts), radius_m)
    vertices, faces = _stumps(starts, ends, radius, radius, sides)
    return mg.TriangularMeshGeometry(vertices, faces, np.repeat(np.tile(axis_colours, (len(X), 1)), 2 * sides, axis=0))


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
