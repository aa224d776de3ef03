"""The part of joint space that the data covered: outside it, nothing but rigid kinematics may be trusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath.lie import Array

JOINT_MARGIN_RAD = np.radians(1.0)
LEAST_SPREAD_RAD = np.radians(1.0)
FADE_RAD = np.radians(10.0)


@dataclass(frozen=True)
class Region:
    """Per joint an interval; jointly an ellipsoid about the mean that holds all the data.

    Attributes:
        lower_rad, upper_rad: ``(n,)`` smallest and largest angle seen.
        mean_rad: ``(n,)``.
        whitening: ``(n, n)`` matrix W; the squared length of W (q - mean) is the Mahalanobis distance.
        radius: largest such distance in the data.
    """

    lower_rad: Array
    upper_rad: Array
    mean_rad: Array
    whitening: Array
    radius: float

    def distance(self, q_rad: Array) -> Array:
        """``(N,)`` Mahalanobis distance in units of the radius: up to 1 the joints were seen together."""
        return np.linalg.norm((q_rad - self.mean_rad) @ self.whitening.T, axis=1) / self.radius

    def contains(self, q_rad: Array) -> Array:
        """``(N,)`` True where each joint, to a degree, and all together are within what was seen."""
        inside = (q_rad >= self.lower_rad - JOINT_MARGIN_RAD) & (q_rad <= self.upper_rad + JOINT_MARGIN_RAD)
        return inside.all(axis=1) & (self.distance(q_rad) <= 1.0 + 1e-9)


def cover(q_rad: Array) -> Region:
    """The region of the poses ``(N, n)``. Joints that hardly moved count as spread over a degree."""
    mean = q_rad.mean(axis=0)
    covariance = np.atleast_2d(np.cov(q_rad, rowvar=False)) + LEAST_SPREAD_RAD**2 * np.eye(q_rad.shape[1])
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    radius = float(np.linalg.norm((q_rad - mean) @ whitening.T, axis=1).max())
    return Region(q_rad.min(axis=0), q_rad.max(axis=0), mean, whitening, radius)


def fade(theta: Array, lower_rad: Array | float, upper_rad: Array | float, over_rad: float = FADE_RAD) -> Array:
    """1 within the limits, 0 so far outside, ten degrees if not said otherwise, smooth between.

    Any shapes that broadcast.
    """
    return smooth_step(1.0 - np.maximum(lower_rad - theta, theta - upper_rad) / over_rad)


def smooth_step(t: Array) -> Array:
    """0 up to t = 0, 1 from t = 1 on, with two continuous derivatives (a quintic) between."""
    t = np.clip(t, 0.0, 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
