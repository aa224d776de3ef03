"""Where the data reached: only there may a network be trusted, which outside says anything at all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truepath.lie import Array
from truepath.region import fade, smooth_step

LEAST_HALF_RANGE_RAD = np.radians(10.0)
MOST_POSES = 500
SHARPNESS = 8.0  # of the soft minimum, over the squared median distance
NEARLY_ALL = 0.99
# Networks are trusted half as far as named causes: up to ten degrees beyond, they made a real UR5 worse by 8 %.
JOINT_FADE_RAD = np.radians(5.0)
FADES_FROM, FADES_TO = 1.25, 2.0  # times the usual distance to the nearest pose
DIGITS = 6
SAME_POSE_DIGITS = 3  # of a joint, rad
CHUNK = 1024


@dataclass(frozen=True, eq=False)
class Reach:
    """Per joint an interval, jointly the neighbourhood of measured poses.

    Distances between poses are taken with each joint in units of half its measured range.

    Attributes:
        lower_rad, upper_rad: ``(n,)`` smallest and largest angle measured.
        poses_rad: ``(K, n)`` measured poses, so many that no other one is far from all of them.
        median, spacing: of the distances from measured poses to the nearest other pose of these: the median, and what
            nearly all of them stay below.
    """

    lower_rad: Array
    upper_rad: Array
    poses_rad: Array
    median: float
    spacing: float

    @classmethod
    def of(cls, q_rad: Array) -> Reach:
        """The reach of measured joints ``(N, n)``, two poses at least."""
        lower, upper = q_rad.min(axis=0), q_rad.max(axis=0)
        unit = half_range(lower, upper)
        # Visits of one pose are no neighbours of each other.
        q_rad = q_rad[np.sort(np.unique(np.round(q_rad, SAME_POSE_DIGITS), axis=0, return_index=True)[1])]
        chosen, distance = _spread_out(q_rad / unit)
        median = max(float(np.median(distance)), 1e-6)
        spacing = max(float(np.quantile(distance, NEARLY_ALL)), 1e-6)
        return cls(lower, upper, np.round(q_rad[chosen], DIGITS), median, spacing)

    @cached_property
    def middle_rad(self) -> Array:
        return 0.5 * (self.lower_rad + self.upper_rad)

    @cached_property
    def half_range_rad(self) -> Array:
        """``(n,)``, of a joint that hardly moved some degrees."""
        return half_range(self.lower_rad, self.upper_rad)

    def scaled(self, q_rad: Array) -> Array:
        """``(N, n)`` joints from -1 to 1 within what was measured."""
        return (q_rad - self.middle_rad) / self.half_range_rad

    def distance(self, q_rad: Array) -> Array:
        """``(N,)`` distance to the nearest measured poses, without a kink where another one becomes the nearest."""
        poses, out = self.scaled(self.poses_rad), np.empty(len(q_rad))
        own = np.sum(poses**2, axis=1)
        sharpness = SHARPNESS / self.median**2
        for k in range(0, len(q_rad), CHUNK):
            x = self.scaled(q_rad[k : k + CHUNK])
            square = np.maximum(np.sum(x**2, axis=1)[:, None] + own - 2.0 * x @ poses.T, 0.0)
            nearest = square.min(axis=1)
            square -= nearest[:, None]
            # As scipy's logsumexp, in a third of the time: this runs for every waypoint.
            nearest -= np.log(np.exp(np.multiply(square, -sharpness, out=square), out=square).sum(axis=1)) / sharpness
            out[k : k + CHUNK] = np.sqrt(np.maximum(nearest, 0.0))
        return out

    def weight(self, q_rad: Array) -> Array:
        """``(N,)`` 1 where the data reached, 0 where it did not, smooth between."""
        alone = fade(q_rad, self.lower_rad, self.upper_rad, JOINT_FADE_RAD).prod(axis=1)
        together = smooth_step((FADES_TO - self.distance(q_rad) / self.spacing) / (FADES_TO - FADES_FROM))
        return alone * together


def half_range(lower_rad: Array, upper_rad: Array) -> Array:
    """``(n,)`` half of what each joint moved by, some degrees at least."""
    return np.maximum(0.5 * (upper_rad - lower_rad), LEAST_HALF_RANGE_RAD)


def _spread_out(x: Array) -> tuple[Array, Array]:
    """Numbers of poses that lie far from each other (each the farthest from those before), and how near the others are.

    Returns:
        ``(K,)`` and, for all poses ``(N,)``, the distance to the nearest chosen one other than itself.
    """
    count = min(MOST_POSES, len(x))
    chosen = np.zeros(count, int)
    nearest = np.linalg.norm(x - x[0], axis=1)
    for k in range(1, count):
        chosen[k] = np.argmax(nearest)
        nearest = np.minimum(nearest, np.linalg.norm(x - x[chosen[k]], axis=1))
    others = np.linalg.norm(x[chosen][:, None] - x[chosen][None], axis=2) + np.diag(np.full(count, np.inf))
    nearest[chosen] = others.min(axis=1) if count > 1 else 0.0
    return chosen, nearest
