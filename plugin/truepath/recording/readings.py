"""From many readings of a reflector that stands still to one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath import lie
from truepath.lie import Array

FAR_IN_SIGMAS = 5.0
SIGMA_OF_MEDIAN_DISTANCE = 1.5382  # median length of a 3D normal vector of unit standard deviation per axis
FEWEST_TO_JUDGE = 8  # of fewer nobody can say which is far off: they count, and so does their spread


class BeamBroken(RuntimeError):  # noqa: N818 - an event at the tracker, not a mistake in a program
    """There is no reading: the tracker does not see the reflector, or cannot be heard."""


@dataclass(frozen=True, eq=False)
class Reading:
    """An average. M is the tracker's frame, E the probe.

    Attributes:
        p_ME: ``(3,)`` m.
        R_ME: ``(3, 3)``, None from a tracker without orientation.
        spread_mm: root of the mean square distance of the readings from their average.
        count: how many readings it is made of.
        t_s: the tracker's clock at the last of them.
    """

    p_ME: Array
    R_ME: Array | None
    spread_mm: float
    count: int
    t_s: float


def average(numbers: Array) -> Reading:
    """The mean of ``(K, 4)`` or ``(K, 8)`` readings (s, mm, quaternion) without those far off, as by a glint.

    Far is 5 standard deviations from the median, the standard deviation being that of the median distance. Orientations
    are averaged as the eigenvector of the sum of q q^T (Markley, Cheng, Crassidis, Oshman 2007, eq. 12 and 13).
    """
    position = 1e-3 * numbers[:, 1:4]
    distance = np.linalg.norm(position - np.median(position, axis=0), axis=1)
    kept = distance <= FAR_IN_SIGMAS * np.median(distance) / SIGMA_OF_MEDIAN_DISTANCE
    if len(numbers) < FEWEST_TO_JUDGE:
        kept[:] = True
    p_ME = position[kept].mean(axis=0)
    spread_mm = 1e3 * float(np.sqrt(np.mean(np.sum((position[kept] - p_ME) ** 2, axis=1))))
    R_ME = None
    if numbers.shape[1] > 4:
        quaternion = numbers[kept, 4:]
        R_ME = lie.from_quaternion(np.linalg.eigh(quaternion.T @ quaternion)[1][None, :, -1])[0]
    return Reading(p_ME, R_ME, spread_mm, int(kept.sum()), float(numbers[-1, 0]))
