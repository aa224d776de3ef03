"""The part of space that the calibration covers, as a surface: flange positions that the joints of its region reach."""

from __future__ import annotations

import numpy as np
from scipy import ndimage, sparse

from truepath.lie import Array
from truepath.model import nominal_flange_poses
from truepath.region import Region
from truepath.robot import NominalRobot

SAMPLES = 60_000
CELLS_ACROSS, BLUR_CELLS, FULL = 26, 1.0, 0.4
MARGIN = 4  # empty cells all around
SMOOTHING_ROUNDS, SMOOTHING = 12, (0.5, -0.53)  # Taubin 1995: a step in and a step out, so that nothing shrinks


def covered_surface(region: Region, robot: NominalRobot) -> tuple[Array, Array] | None:
    """Vertices ``(V, 3)`` in B, m, and faces ``(F, 3)`` around what is covered; always the same for the same region.

    A place counts as covered if the flange gets there in some posture of the region; other postures may lie outside.
    None where the region holds no volume.
    """
    points = _reached(region, robot)
    if len(points) < 2:
        return None
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    cell = float(extent.max()) / CELLS_ACROSS
    if not cell > 0:
        return None
    index = np.floor((points - low) / cell).astype(int) + MARGIN
    filled = np.zeros(index.max(axis=0) + 1 + MARGIN, bool)
    filled[tuple(index.T)] = True
    blurred = ndimage.gaussian_filter(ndimage.binary_closing(filled).astype(float), BLUR_CELLS)
    vertices, faces = _boundary(blurred > FULL)
    return (_smoothed(vertices, faces) * cell + low - MARGIN * cell, faces) if len(faces) else None


def _reached(region: Region, robot: NominalRobot) -> Array:
    """``(K, 3)`` flange positions of joints drawn evenly from the region."""
    rng, n = np.random.default_rng(0), robot.num_joints
    direction = rng.normal(size=(SAMPLES, n))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    ball = direction * rng.random((SAMPLES, 1)) ** (1 / n)
    q = region.mean_rad + region.radius * np.linalg.solve(region.whitening, ball.T).T
    return nominal_flange_poses(robot, q[region.contains(q)])[:, :3, 3]


def _boundary(filled: Array) -> tuple[Array, Array]:
    """Corners ``(V, 3)``, in cells, and triangles ``(F, 3)`` of the walls between filled cells and empty ones."""
    squares = []
    for axis in range(3):
        across, along = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        step = np.diff(filled.astype(int), axis=axis)
        for sign in (1, -1):
            corner = np.argwhere(step == sign) + np.eye(3, dtype=int)[axis]
            around = np.stack([0 * across, across, across + along, along])
            squares.append(corner[:, None] + (around if sign < 0 else around[::-1]))
    corners, number = np.unique(np.concatenate(squares).reshape(-1, 3), axis=0, return_inverse=True)
    square = number.reshape(-1, 4)
    return corners.astype(float), np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])


def _smoothed(vertices: Array, faces: Array) -> Array:
    """The vertices with the steps of the cells taken off."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ends = np.unique(np.concatenate([ends, ends[:, ::-1]]), axis=0)
    linked = sparse.csr_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(vertices),) * 2)
    count = np.asarray(linked.sum(axis=1))
    for _ in range(SMOOTHING_ROUNDS):
        for share in SMOOTHING:
            vertices = vertices + share * (linked @ vertices / count - vertices)
    return vertices
