"""One correction after the other in a control loop, where nothing can be refused: what cannot be corrected is faded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from truepath.correct import LIMIT_ROUNDING_RAD, MAX_CORRECTION_MM, MAX_JOINT_CORRECTION_RAD
from truepath.errors import InputError
from truepath.host.one_pose import OnePose
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.region import smooth_step

DIFFERENCE_RAD = 1e-4  # of joints, for derivatives
SECOND_DIFFERENCE_RAD = 1e-3  # for those of derivatives


class Corrected(NamedTuple):
    """Joints ``(n,)`` to send, and whether they are all of the correction that ``correct`` would have made."""

    q_rad: Array
    valid: bool


class SteadyCorrection:
    """Corrects joints so that the result is a continuous function of them, whatever comes.

    Where ``correct`` corrects, this gives the same joints. Where it would refuse:

    - The correction is larger than is allowed (a position by ``max_correction_mm``, a joint by 0.15 rad, as near a
      singularity): it fades, from all of it at the bound to nothing at twice the bound. So it has faded to nothing
      where there is none to be found.
    - A corrected joint passes a limit: it stops there. (A programmed joint beyond a limit is not moved further out.)

    Outside the region that was measured ``correct`` does not refuse, and neither does this: effects and networks fade
    there by themselves, and the kinematics is extrapolated.

    Args:
        model: the calibrated robot.
        max_correction_mm: by which the flange may be moved, in nominal kinematics.

    Raises:
        InputError: a robot of less than six joints; a bound that is none.
    """

    def __init__(self, model: CalibratedModel, max_correction_mm: float = MAX_CORRECTION_MM) -> None:
        robot = model.robot
        if robot.num_joints < 6:
            raise InputError(
                f"{robot.name} has {robot.num_joints} joints", expected="six or more: a pose has six degrees of freedom"
            )
        if not 0 < max_correction_mm < np.inf:
            raise InputError("this is no bound of a correction", expected="mm", found=str(max_correction_mm))
        self._solver, self._most_m = OnePose(model), 1e-3 * max_correction_mm
        self._lower, self._upper = robot.lower_rad - LIMIT_ROUNDING_RAD, robot.upper_rad + LIMIT_ROUNDING_RAD

    def __call__(self, q_rad: Array) -> Corrected:
        """For programmed joints ``(n,)``."""
        solved = self._solver.solve(q_rad)
        if not solved.converged:
            return Corrected(np.array(q_rad, float), False)
        change = solved.q_rad - q_rad
        size = max(solved.displacement_m / self._most_m, float(np.abs(change).max()) / MAX_JOINT_CORRECTION_RAD)
        valid, q_out = size <= 1.0, solved.q_rad
        if not valid:
            q_out = q_rad + float(smooth_step(np.asarray(2.0 - size))) * change
        if not ((q_out >= self._lower) & (q_out <= self._upper)).all():
            valid = False
            q_out = np.clip(q_out, np.minimum(self._lower, q_rad), np.maximum(self._upper, q_rad))
        return Corrected(q_out, bool(valid and ((q_rad >= self._lower) & (q_rad <= self._upper)).all()))

    def along(self, q_rad: Array, direction: Array) -> Array:
        """``(n,)`` derivative of the corrected joints as the programmed ones ``(n,)`` move along ``(n,)``.

        By central differences, good to about 1e-5 of itself.
        """
        longest = float(np.abs(direction).max())
        if not longest > 0.0:
            return np.zeros_like(q_rad)
        step = DIFFERENCE_RAD / longest
        ahead, behind = self(q_rad + step * direction).q_rad, self(q_rad - step * direction).q_rad
        return (ahead - behind) / (2.0 * step)

    def jacobian(self, q_rad: Array) -> Array:
        """``(n, n)`` the same along each joint."""
        return np.stack([self.along(q_rad, unit) for unit in np.eye(len(q_rad))], axis=1)

    def along_and_around(self, q_rad: Array, direction: Array) -> Array:
        """``(n, n)`` derivative of ``along(q_rad, direction)`` as each of the programmed joints moves.

        By central differences of differences, good to about 1e-4 of the direction where the correction is smooth.
        """
        longest = float(np.abs(direction).max())
        if not longest > 0.0:
            return np.zeros((len(q_rad), len(q_rad)))
        step = SECOND_DIFFERENCE_RAD / longest * direction
        columns = []
        for unit in SECOND_DIFFERENCE_RAD * np.eye(len(q_rad)):
            slopes = [self(q_rad + side + step).q_rad - self(q_rad + side - step).q_rad for side in (unit, -unit)]
            columns.append((slopes[0] - slopes[1]) * longest / (2.0 * SECOND_DIFFERENCE_RAD) ** 2)
        return np.stack(columns, axis=1)
