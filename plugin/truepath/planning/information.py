"""What a reading tells about the parameters of a model, and what their uncertainty does to the tool.

Near a model the readings are y = A x + noise (``effect_fit.linearise``), x being the free kinematic parameters and
those of the effects. Visits of poses leave x the covariance (A^T A / sigma^2 + prior^-2)^-1, with the priors that the
fit has. Parameters are counted in units of their prior widths, so that the prior adds the identity to the information.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from truepath import poe
from truepath.calibrate import free_parameters, prior_widths
from truepath.context import Context
from truepath.effect_fit import FRAME_PRIOR, linearise
from truepath.effects.base import Term
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import no_deviation, nominal_flange_poses
from truepath.poe_symbolic import PoseProblem
from truepath.robot import NominalRobot
from truepath.term_set import TermSet


@dataclass(frozen=True, eq=False)
class ReadingModel:
    """K parameters, and how a reading of m components changes with them. M measurement frame, E probe.

    Attributes:
        robot: nominal robot.
        p: ``(4 n + 12,)`` deviations about which the readings are linearised.
        free: ``(4 n + 12,)`` True for those that a calibration estimates.
        X_MB, X_FE: ``(4, 4)`` frames from which p counts.
        terms: of the effects.
        widths: ``(K,)`` prior widths, SI: the units of the parameters here.
        sigma: ``(m,)`` noise of a reading, m and rad; m is 3 or 6.
        later: what a context says of all poses to come, such as their time; by its names.
    """

    robot: NominalRobot
    p: Array
    free: Array
    X_MB: Array
    X_FE: Array
    terms: tuple[Term, ...]
    widths: Array
    sigma: Array
    later: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def nominal(
        cls, robot: NominalRobot, X_FE: Array, q_rad: Array, terms: tuple[Term, ...], sigma: Array
    ) -> ReadingModel:
        """Before anything is measured: about the robot as drawn, in its world.

        Args:
            robot: nominal robot.
            X_FE: ``(4, 4)`` probe on the flange.
            q_rad: ``(k, n)`` poses that can be measured: what they cannot tell apart is not estimated.
            terms: of the effects.
            sigma: ``(m,)`` noise.
        """
        p = no_deviation(robot)
        everything = cls(robot, p, np.ones(len(p), bool), robot.X_WB, X_FE, (), np.ones(len(p)), sigma)
        free = free_parameters(everything.readings(q_rad), poe.parameter_names(robot.num_joints))
        widths = np.minimum(prior_widths(poe.parameter_names(robot.num_joints))[free], FRAME_PRIOR)
        plausible = [parameter.prior_scale for term in terms for parameter in term.parameters]
        return cls(robot, p, free, robot.X_WB, X_FE, terms, np.concatenate([widths, plausible]), sigma)

    @property
    def kinematic(self) -> tuple[poe.ParameterName, ...]:
        """Names of the free kinematic parameters, which come first."""
        return tuple(n for n, free in zip(poe.parameter_names(self.robot.num_joints), self.free, strict=True) if free)

    @property
    def by_approach(self) -> bool:
        """Whether an effect depends on the side from which a joint arrives."""
        return any("approach" in term.inputs for term in self.terms)

    def readings(self, q_rad: Array, approach: Array | None = None) -> Array:
        """``(N, m, K)`` derivatives of the readings at joints ``(N, n)``, in units of their noise.

        Args:
            q_rad: commanded joints.
            approach: ``(N, n)`` in {-1, 0, 1}, direction in which each joint arrives; None where it does not matter.
        """
        return self._derivatives(q_rad, approach, len(self.sigma)) / self.sigma[:, None]

    def tool(self, q_rad: Array, approach: Array | None = None) -> Array:
        """``(N, 3, K)`` derivatives of the probe's position in M at joints ``(N, n)``, m."""
        return self._derivatives(q_rad, approach, 3)

    def _derivatives(self, q_rad: Array, approach: Array | None, components: int) -> Array:
        N = len(q_rad)
        X_ME = self.X_MB @ nominal_flange_poses(self.robot, q_rad) @ self.X_FE
        context = Context(q_rad, approach=np.zeros_like(q_rad) if approach is None else approach, p_ME=X_ME[:, :3, 3])
        context = replace(context, **{name: np.full(N, value) for name, value in self.later.items()})
        # The derivative of an orientation is taken near where it would be measured.
        new = Measurements(q_rad, X_ME[:, :3, 3], X_ME[:, :3, :3].copy() if components == 6 else None)
        problem = PoseProblem(self.robot, new, self.X_MB, self.X_FE)
        terms = TermSet.of(self.robot, context, self.terms)
        near = linearise(problem, self.free, context, terms, self.p, np.zeros(len(terms)))
        return np.concatenate([near.kinematics, near.effects], axis=2) * self.widths


def tool_sigma(tool: Array, covariance: Array) -> Array:
    """``(N,)`` standard deviation of the position, all directions together, for ``ReadingModel.tool`` ``(N, 3, K)``."""
    return np.sqrt(np.maximum(np.einsum("nij,nij->n", tool @ covariance, tool), 0.0))
