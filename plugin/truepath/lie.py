"""Batched rigid-body algebra on plain arrays.

Shapes: rotations ``(..., 3, 3)``, poses ``(..., 4, 4)``, twists ``(..., 6)`` ordered (angular, linear).
Quaternions are scalar first, ``(w, x, y, z)``. Lengths in metres, angles in radians.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[Any]  # dtype and shape stand in each docstring


def make_pose(rotation: Array | None = None, translation: Array | None = None) -> Array:
    """Poses ``(..., 4, 4)`` from rotations ``(..., 3, 3)`` and translations ``(..., 3)``; either may be left out."""
    rotation = np.eye(3) if rotation is None else np.asarray(rotation, float)
    translation = np.zeros(3) if translation is None else np.asarray(translation, float)
    batch = np.broadcast_shapes(rotation.shape[:-2], translation.shape[:-1])
    pose = np.zeros((*batch, 4, 4))
    pose[..., :3, :3] = rotation
    pose[..., :3, 3] = translation
    pose[..., 3, 3] = 1.0
    return pose


def invert(pose: Array) -> Array:
    """Inverse of poses ``(..., 4, 4)``."""
    rotation_t = np.swapaxes(pose[..., :3, :3], -1, -2)
    return make_pose(rotation_t, -np.einsum("...ij,...j->...i", rotation_t, pose[..., :3, 3]))


def skew(v: Array) -> Array:
    """Cross-product matrices ``(..., 3, 3)`` of vectors ``(..., 3)``."""
    v = np.asarray(v, float)
    m = np.zeros((*v.shape[:-1], 3, 3))
    m[..., 0, 1], m[..., 0, 2], m[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    m[..., 1, 0], m[..., 2, 0], m[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return m


def rotation_vector(rotation: Array) -> Array:
    """Rotation vectors ``(..., 3)`` in rad (matrix logarithm) of rotations ``(..., 3, 3)``."""
    flat = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec()
    return np.asarray(flat).reshape(*rotation.shape[:-2], 3)


def from_rotation_vector(vector: Array) -> Array:
    """Rotations ``(..., 3, 3)`` from rotation vectors ``(..., 3)`` in rad."""
    vector = np.asarray(vector, float)
    flat = Rotation.from_rotvec(vector.reshape(-1, 3)).as_matrix()
    return np.asarray(flat).reshape(*vector.shape[:-1], 3, 3)


def to_quaternion(rotation: Array) -> Array:
    """Unit quaternions ``(..., 4)``, scalar first and with w >= 0, of rotations ``(..., 3, 3)``."""
    flat = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_quat(canonical=True, scalar_first=True)
    return np.asarray(flat).reshape(*rotation.shape[:-2], 4)


def from_quaternion(quaternion: Array) -> Array:
    """Rotations ``(..., 3, 3)`` from quaternions ``(..., 4)``, scalar first; they are normalised."""
    quaternion = np.asarray(quaternion, float)
    flat = Rotation.from_quat(quaternion.reshape(-1, 4), scalar_first=True).as_matrix()
    return np.asarray(flat).reshape(*quaternion.shape[:-1], 3, 3)


def pose_error(X_actual: Array, X_wanted: Array) -> Array:
    """Twist-like errors ``(..., 6)``: rotation vector and translation from wanted to actual, in the common frame."""
    rotation = X_actual[..., :3, :3] @ np.swapaxes(X_wanted[..., :3, :3], -1, -2)
    return np.concatenate([rotation_vector(rotation), X_actual[..., :3, 3] - X_wanted[..., :3, 3]], axis=-1)


def nearest_rotation(matrix: Array) -> Array:
    """The rotation ``(3, 3)`` closest to a matrix in the Frobenius norm (orthogonal Procrustes, det = +1)."""
    u, _, vt = np.linalg.svd(matrix)
    return np.asarray(u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt)
