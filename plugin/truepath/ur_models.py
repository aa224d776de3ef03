"""The kinematics of Universal Robots as their maker publishes them.

Source: Universal Robots, "DH Parameters for calculations of kinematics and dynamics". Standard Denavit-Hartenberg:
T_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i). Frames: C the controller's base, 0 its tool flange.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath import lie
from truepath.lie import Array

ALPHA_RAD = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
LENGTHS_M = {  # d1, a2, a3, d4, d5, d6
    "UR3": (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
    "UR5": (0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823),
    "UR10": (0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922),
    "UR3e": (0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
    "UR5e": (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "UR10e": (0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
    "UR16e": (0.1807, -0.4784, -0.36, 0.17415, 0.11985, 0.11655),
    "UR15": (0.2186, -0.6475, -0.5164, 0.1824, 0.1361, 0.1434),
    "UR20": (0.2363, -0.862, -0.7287, 0.201, 0.1593, 0.1543),
    "UR30": (0.2363, -0.637, -0.5037, 0.201, 0.1593, 0.1543),
}


@dataclass(frozen=True, eq=False)
class AtZero:
    """An arm with all joints at zero: all that its kinematics is.

    Attributes:
        X_CA: ``(6, 4, 4)`` a frame on each axis, z along it.
        X_C0: ``(4, 4)`` tool flange.
    """

    X_CA: Array
    X_C0: Array


def published(model: str) -> Array:
    """``(4, 6)`` theta (rad), a (m), d (m), alpha (rad) of a model, rows as in ``calibration.conf``."""
    d1, a2, a3, d4, d5, d6 = LENGTHS_M[model]
    return np.array([[0.0] * 6, [0, a2, a3, 0, 0, 0], [d1, 0, 0, d4, d5, d6], ALPHA_RAD])


def chain(parameters: Array) -> AtZero:
    """The arm with these Denavit-Hartenberg parameters ``(4, 6)``, its joints being added to theta."""
    X = np.eye(4)
    axes = []
    for theta, a, d, alpha in parameters.T:
        axes.append(X)
        turned = lie.make_pose(lie.from_rotation_vector(np.array([0, 0, theta])), np.array([0, 0, d]))
        X = X @ turned @ lie.make_pose(lie.from_rotation_vector(np.array([alpha, 0, 0])), np.array([a, 0, 0]))
    return AtZero(np.stack(axes), X)


@dataclass(frozen=True)
class Misfit:
    """How far two arms are apart at zero: the axis or flange that is worst, as ``part``; m and rad."""

    part: str
    distance_m: float
    angle_rad: float


def misfit(one: AtZero, other: AtZero) -> Misfit:
    """Where two arms differ most, 20 mm counting as much as 0.1 rad.

    An axis is a line: what counts is how far the other arm's line misses the origin of this one's axis frame, and
    the angle between the lines. So parameters that only move frames along an axis, by however much, do not count.
    """
    z, z_other = one.X_CA[:, :3, 2], other.X_CA[:, :3, 2]
    between = one.X_CA[:, :3, 3] - other.X_CA[:, :3, 3]
    distance = np.linalg.norm(np.cross(z_other, between), axis=1)
    angle = np.arctan2(np.linalg.norm(np.cross(z, z_other), axis=1), np.einsum("ij,ij->i", z, z_other))
    flange = np.linalg.norm(lie.pose_error(one.X_C0, other.X_C0).reshape(2, 3), axis=1)
    distance, angle = np.append(distance, flange[1]), np.append(angle, flange[0])
    worst = int(np.argmax(np.maximum(distance / 0.02, angle / 0.1)))
    return Misfit(f"axis {worst + 1}" if worst < 6 else "flange", float(distance[worst]), float(angle[worst]))
