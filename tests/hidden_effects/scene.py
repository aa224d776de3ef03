"""What stood where during a campaign, what a cause moves, and how far the reflector goes by it.

Frames: W world, M measurement frame, Ji the parent's side of joint i (z along its axis), E reflector, F flange.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class Scene:
    """N visits of an undisturbed robot (no cause acts yet), n joints, SI units.

    Attributes:
        q: ``(N, n)`` commanded joints.
        time_s, temperature_c, payload_kg: ``(N,)``; approach: ``(N, n)`` -1 or +1.
        span_s: how long the first campaign took; time starts at 0.
        p_ME: ``(N, 3)``, R_ME: ``(N, 3, 3)``: the reflector, by Drake.
        p_MJ: ``(N, n, 3)``, R_MJ: ``(N, n, 3, 3)``: the joints' frames, by Drake.
        p_MF: ``(N, 3)`` flange origin.
        down_M: ``(3,)`` acceleration of gravity.
        gravity_torque: ``(N, n)`` about each axis, by Drake, payload included.
        gravity_moment: ``(N, n, 3)`` moment of all weight outboard of each joint about its origin.
    """

    q: np.ndarray
    time_s: np.ndarray
    temperature_c: np.ndarray
    payload_kg: np.ndarray
    approach: np.ndarray
    span_s: float
    p_ME: np.ndarray
    R_ME: np.ndarray
    p_MJ: np.ndarray
    R_MJ: np.ndarray
    p_MF: np.ndarray
    down_M: np.ndarray
    gravity_torque: np.ndarray
    gravity_moment: np.ndarray

    def __len__(self):
        return len(self.q)

    @property
    def axes(self):
        """``(N, n, 3)`` joint axes in M."""
        return self.R_MJ[..., 2]

    @property
    def progress(self):
        """``(N,)`` time in units of the first campaign, 1 at its end."""
        return self.time_s / self.span_s

    def still(self):
        """No motion at all."""
        N, n = self.q.shape
        return Motion(np.zeros((N, n)), np.zeros((N, n, 6)), np.zeros((N, 3)), np.zeros((N, 6)), np.zeros((N, 3)))

    def turning(self, joint, angle_rad):
        """Motion in which a joint (from 1) goes ``angle_rad`` ``(N,)`` too far."""
        motion = self.still()
        motion.joint_rad[:, joint - 1] = angle_rad
        return motion

    def carrying(self, joint, twist):
        """Motion in which the bearing of a joint (from 1) moves by ``twist`` ``(N, 6)`` in its own frame Ji."""
        motion = self.still()
        motion.bearing[:, joint - 1] = twist
        return motion

    def standing(self, twist):
        """Motion of the whole robot by ``twist`` ``(N, 6)`` about the origin of M."""
        return replace(self.still(), base=twist)

    def misread(self, error_m):
        """No motion, but the tracker reads a position ``error_m`` ``(N, 3)`` off."""
        return replace(self.still(), misread_m=error_m)

    def slipping(self, shift_m):
        """Motion of the reflector on the flange by ``shift_m`` ``(N, 3)`` in its own frame E."""
        return replace(self.still(), probe_m=shift_m)


@dataclass(frozen=True)
class Motion:
    """What a cause moves in each of N visits.

    Attributes:
        joint_rad: ``(N, n)`` added to the joint angles.
        bearing: ``(N, n, 6)`` twist (rotation rad, translation m) of joint frames in themselves.
        probe_m: ``(N, 3)`` shift of the reflector in its own frame.
        base: ``(N, 6)`` twist of the whole robot in M.
        misread_m: ``(N, 3)`` what the tracker adds to the position.
    """

    joint_rad: np.ndarray
    bearing: np.ndarray
    probe_m: np.ndarray
    base: np.ndarray
    misread_m: np.ndarray

    def __add__(self, other):
        return Motion(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))

    def __mul__(self, factor):
        return Motion(*(factor * getattr(self, f.name) for f in fields(self)))


def field(scene, motion):
    """``(N, 6)`` what a small motion does to the measured pose: displacement in m, rotation in rad, both in M."""
    axes, lever = scene.axes, scene.p_ME[:, None] - scene.p_MJ
    turn = scene.R_MJ @ motion.bearing[..., :3, None]
    push = scene.R_MJ @ motion.bearing[..., 3:, None]
    turns = axes * motion.joint_rad[..., None] + turn[..., 0]
    displacement = np.sum(np.cross(turns, lever) + push[..., 0], axis=1)
    displacement += np.cross(motion.base[:, :3], scene.p_ME) + motion.base[:, 3:] + motion.misread_m
    displacement += (scene.R_ME @ motion.probe_m[..., None])[..., 0]
    return np.concatenate([displacement, turns.sum(axis=1) + motion.base[:, :3]], axis=1)


class Visible:
    """The part of a field that neither geometry nor frames can imitate, in sigmas of the noise.

    Args:
        scene: where the robot was.
        noise_m, noise_rad: of each coordinate; ``noise_rad`` None if no orientation is measured.
    """

    def __init__(self, scene, noise_m, noise_rad):
        self._weight = np.array([1 / noise_m] * 3 + ([] if noise_rad is None else [1 / noise_rad] * 3))
        columns = [self._whiten(column) for column in _geometry(scene)]
        self._imitations = _span(np.stack(columns, axis=1))

    def part(self, field, rivals=()):
        """``(3 N or 6 N,)`` whitened rest of a field after geometry, frames and rival fields did their best."""
        rest = self._rest(self._whiten(field))
        basis = self.directions(rivals)
        return rest - basis @ (basis.T @ rest)

    def directions(self, fields):
        """Orthonormal columns that span what geometry and frames leave of some fields."""
        if not fields:
            return np.zeros((self._imitations.shape[0], 0))
        return _span(np.stack([self._rest(self._whiten(each)) for each in fields], axis=1))

    def rms(self, field, rivals=()):
        """Root mean square of a coordinate of the position, in sigmas."""
        rest = self.part(field, rivals).reshape(-1, len(self._weight))
        return float(np.sqrt(np.mean(rest[:, :3] ** 2)))

    def strength(self, field, rivals=()):
        """What the whole rest adds to chi-square, as its root."""
        return float(np.linalg.norm(self.part(field, rivals)))

    def _whiten(self, field):
        return (field[:, : len(self._weight)] * self._weight).ravel()

    def _rest(self, vector):
        return vector - self._imitations @ (self._imitations.T @ vector)


def _geometry(scene):
    """Fields of every constant error of a joint frame (the first stands for the base) and of the probe."""
    for joint in range(1, scene.q.shape[1] + 1):
        for twist in np.eye(6):
            yield field(scene, scene.carrying(joint, twist))
    for k in range(3):
        yield field(scene, scene.slipping(np.tile(np.eye(3)[k], (len(scene), 1))))
        yield np.concatenate([np.zeros((len(scene), 3)), scene.R_ME[..., k]], axis=1)


def _span(columns):
    """Orthonormal basis of the columns, those left out that are combinations of others."""
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0] / size[size > 0]
    if not columns.shape[1]:
        return columns
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, s > 1e-7 * s[0]]


def rotation(vector):
    """Rotations ``(..., 3, 3)`` from rotation vectors ``(..., 3)``."""
    return Rotation.from_rotvec(np.reshape(vector, (-1, 3))).as_matrix().reshape(*np.shape(vector), 3)
