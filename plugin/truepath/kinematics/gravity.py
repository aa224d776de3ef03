"""The moment of gravity as a CasADi expression: ``NominalRobot.gravity_moment`` for rows of poses."""

from __future__ import annotations

import casadi as ca
import numpy as np

from truepath import poe
from truepath.lie import Array
from truepath.robot import NominalRobot

ROUNDING = 1e-15  # what a drawing with right angles leaves where a zero is meant


def gravity_moments(robot: NominalRobot, sin: ca.SX, cos: ca.SX, payload_kg: float) -> list[ca.SX]:
    """Moments ``(3,)`` of gravity about the origin of each axis frame, in that frame before its joint turns, N m.

    From the flange to the base: first moment of mass of all that a joint carries; from the base to the flange: the
    direction of gravity; both in the axis frames, where the zeros of a drawing with right angles leave little to do.

    Args:
        robot: nominal robot.
        sin, cos: ``(n,)`` of the joint angles.
        payload_kg: point mass at the flange origin.
    """
    n = robot.num_joints
    links = [_clean(link) for link in poe.link_transforms(robot.X_BA, robot.X_BF)]
    gravity = [ca.SX(_clean(links[0][:3, :3].T @ robot.gravity_B))]
    for i in range(1, n):
        gravity.append(ca.mtimes(links[i][:3, :3].T, _turned(gravity[-1], -sin[i - 1], cos[i - 1])))
    mass, first_moment = payload_kg, payload_kg * ca.SX(links[n][:3, 3])
    moments: list[ca.SX] = []
    for i in range(n - 1, -1, -1):
        X_AB = np.linalg.inv(robot.X_BA[i])
        centre = _clean(X_AB[:3, :3] @ robot.p_BoLcm_B[i] + X_AB[:3, 3])
        mass += float(robot.link_mass_kg[i])
        first_moment = _turned(first_moment + robot.link_mass_kg[i] * centre, sin[i], cos[i])
        moments.append(ca.cross(first_moment, gravity[i]))
        first_moment = ca.mtimes(links[i][:3, :3], first_moment) + mass * links[i][:3, 3]
    return moments[::-1]


def _turned(vector: ca.SX, sin: ca.SX, cos: ca.SX) -> ca.SX:
    """About z."""
    x, y, z = vector[0], vector[1], vector[2]
    return ca.vertcat(cos * x - sin * y, sin * x + cos * y, z)


def _clean(array: Array) -> Array:
    return np.where(np.abs(array) < ROUNDING * max(1.0, float(np.abs(array).max())), 0.0, array)
