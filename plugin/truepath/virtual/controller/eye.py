"""The simulated tracker looks at the real robot behind the controller. All truth is Drake's.

Frames: W world of the cell, M tracker, E reflector.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array
from truepath.virtual.controller.machine import Machine
from truepath.virtual.controller.tracker_stream import Sight
from truepath.virtual.hidden_causes import draw_causes, true_poses
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.visits import Visits


class Eye:
    """Knows where the reflector truly is. Any thread may ask.

    Args:
        machine: whose commanded joints it looks at.
        spec, seed: of the real robot.
        hide: names of hidden causes.
        noise_mm: standard deviation of each coordinate of a reading.
        X_MW: ``(4, 4)`` the cell as the tracker, which is in the origin of M, sees it; by default M is W.
        acceptance_deg: half angle of the cone about the reflector's z axis in which it returns the beam of a tracker
            that stands somewhere.

    Raises:
        InputError: no such robot or cause, a noise or an angle that is none.
    """

    def __init__(
        self,
        machine: Machine,
        spec: str,
        seed: int,
        hide: Sequence[str] = (),
        noise_mm: float = 0.0,
        X_MW: Array | None = None,
        acceptance_deg: float = 180.0,
    ) -> None:
        if not (math.isfinite(noise_mm) and noise_mm >= 0):
            raise InputError("this is no size of noise", expected="0 or a finite positive number", found=str(noise_mm))
        if not 0 < acceptance_deg <= 180:
            raise InputError("no reflector has such a cone", expected="0 to 180 deg", found=str(acceptance_deg))
        self._machine, self._noise_m, self._X_MW = machine, 1e-3 * noise_mm, X_MW
        self._least_cosine = math.cos(math.radians(acceptance_deg))
        self._real = RealRobot(spec, seed)
        self._causes = list(draw_causes(self._real, hide).values())
        self._dice = np.random.default_rng([seed, 7])
        self._lock = threading.Lock()
        self._hidden_until = 0.0

    def break_beam(self, wall_seconds: float) -> None:
        """Something stands in the way for that long."""
        self._hidden_until = time.monotonic() + wall_seconds

    def mend_beam(self) -> None:
        """Nothing does."""
        self._hidden_until = 0.0

    def truth(self, time_s: float | None = None) -> Array:
        """``(4, 4)`` X_ME of the true reflector, without noise."""
        with self._lock:
            return true_poses(self._real, self._visit(time_s), self._causes, self._X_MW)[0]

    def true_joints(self) -> Array:
        """``(6,)`` where the joints stand, hidden causes being at work."""
        with self._lock:
            visit = self._visit(None)
            return sum((cause.joint_errors(visit) for cause in self._causes), visit.q_rad)[0]

    def look(self) -> Sight:
        """One reading, now."""
        time_s = self._machine.clock.now()
        X_ME = self.truth(time_s)
        p_ME = X_ME[:3, 3]
        with self._lock:
            noise = self._dice.normal(scale=self._noise_m, size=3)
        facing = self._X_MW is None or -X_ME[:3, 2] @ p_ME >= self._least_cosine * np.linalg.norm(p_ME)
        return Sight(time_s, p_ME + noise, bool(facing) and time.monotonic() >= self._hidden_until)

    def _visit(self, time_s: float | None) -> Visits:
        arm = self._machine.arm
        time_s = self._machine.clock.now() if time_s is None else time_s
        q, approach = arm.sample(time_s)[0][None], arm.approach[None]
        return Visits(q, np.array([time_s]), approach, self._real.gravity_torques(q))
