"""The circumstances under which a virtual robot comes by its poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath.lie import Array
from truepath.virtual.real_robot import RealRobot

# However many poses: what slips does so at the same time of every campaign, so that a second one can check the first.
CAMPAIGN_S = 3000.0


@dataclass(frozen=True, eq=False)
class Visits:
    """N poses in the order in which a robot comes by, and whatever a cause may go with.

    Attributes:
        q_rad: ``(N, n)`` commanded joints.
        time_s: ``(N,)`` since the campaign began; infinite for poses of later, when all that slips has slipped.
        approach: ``(N, n)`` in {-1, 0, 1}, direction of travel from the pose before (the first: from zero).
        torque_nm: ``(N, n)`` generalized forces of gravity on the joints, by Drake.
    """

    q_rad: Array
    time_s: Array
    approach: Array
    torque_nm: Array

    @classmethod
    def of(cls, real: RealRobot, q_rad: Array, time_s: Array | None = None) -> Visits:
        """A robot on its way along joints ``(N, n)``, at times ``(N,)`` or later than everything."""
        time_s = np.full(len(q_rad), np.inf) if time_s is None else time_s
        return cls(q_rad, time_s, np.sign(np.diff(q_rad, axis=0, prepend=0.0 * q_rad[:1])), real.gravity_torques(q_rad))
