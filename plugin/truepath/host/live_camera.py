"""Where the camera of a host's Meshcat begins."""

from __future__ import annotations

import numpy as np

from truepath.lie import Array

AZIMUTH_RAD, ELEVATION_RAD = np.radians(-55.0), np.radians(24.0)  # azimuth from where the path lies
DISTANCE = 1.3  # in the size of the robot
LOWERED = 0.02  # of the target, likewise: the lowest quarter of the screen is for the text


def beginning(p_WB: Array, points: Array, size_m: float) -> tuple[Array, Array]:
    """Where the camera is and what it looks at, ``(3,)`` each in the world: path and arm are beside each other.

    Args:
        p_WB: ``(3,)`` the base of the robot, in the world.
        points: ``(K, 3)`` of the path, in the world.
        size_m: of the robot.
    """
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    x, y, _ = middle - p_WB
    azimuth, level = np.arctan2(y, x) + AZIMUTH_RAD, np.cos(ELEVATION_RAD)
    direction = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(ELEVATION_RAD)])
    target = 0.35 * p_WB + 0.65 * middle - np.array([0.0, 0.0, LOWERED * size_m])
    return target + DISTANCE * size_m * direction, target
