"""Kinematic calibration: POE deviations and frames by Levenberg-Marquardt on CasADi's exact derivatives.

The steps: closed-form registration of the frames, a robust fit that finds gross errors, rejection of
these, a least-squares fit of the rest in which the noise is estimated too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from truepath import frames, lie, poe
from truepath.errors import CalibrationError
from truepath.identifiability import independent_columns
from truepath.levenberg_marquardt import Solution, covariance, minimise, noise_components
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import CalibratedModel, no_deviation, nominal_flange_poses
from truepath.poe_symbolic import PoseProblem
from truepath.robot import NominalRobot

OUTLIER_PROBABILITY = 1e-3  # of calling any row of a clean data set an outlier
OUTLIER_MARGIN = 1.5  # what is left of an imperfect model has longer tails than noise
ROBUST_ROUNDS, MAX_ROUNDS = 3, 30
NEAR_ENOUGH = 0.1  # of half the chi-square
SPARE_POSES = 3
PRIOR_WIDTH = 3.0  # times the plausible size: wide enough not to matter where the data says anything
REDUNDANT = "redundant: other free parameters have the same effect"
NOT_SEEN = f"not seen: the data leaves it more uncertain than {PRIOR_WIDTH:.0f} times its plausible size"
NOISE_FLOOR = 1e-10  # m and rad; keeps data without noise solvable
LEAST_JOINT_SPREAD_RAD = 1e-3


@dataclass(frozen=True)
class Fit:
    """What a calibration found. Shapes: N poses, k = 4 n + 12 parameters, m = 3 or 6 components.

    Attributes:
        model: the robot as it is.
        names: k parameter names, in the order of model.p.
        covariance: ``(k, k)``, zero rows for held parameters; of the frames it tells about small steps.
        held: number of a parameter to the reason why it stays at nominal.
        sigma_position_m, sigma_orientation_rad: noise per axis, estimated; the latter None for 3D data.
        outlier: ``(N,)`` True for poses left out.
        residual: ``(N, m)`` predicted minus measured, in the measurement frame.
        iterations: evaluations of the model.
    """

    model: CalibratedModel
    names: tuple[poe.ParameterName, ...]
    covariance: Array
    held: dict[int, str]
    sigma_position_m: float
    sigma_orientation_rad: float | None
    outlier: Array
    residual: Array
    iterations: int

    @property
    def sigma(self) -> Array:
        """``(k,)`` standard deviation of each parameter, 0 for held ones."""
        return np.sqrt(np.diag(self.covariance))


def nominal_frames(robot: NominalRobot, measurements: Measurements) -> tuple[Array, Array]:
    """Base and probe frame for the nominal robot: those that are known, the others fitted (``(4, 4)`` each)."""
    X_FE = measurements.X_FE_nominal
    if X_FE is not None and not measurements.has_orientation:
        X_FE = lie.make_pose(translation=X_FE[:3, 3])  # a point has no orientation
    X_BF = nominal_flange_poses(robot, measurements.q_rad)
    return frames.register(X_BF, measurements.p_ME, measurements.R_ME, X_MB=measurements.X_MB_nominal, X_FE=X_FE)


def calibrate(robot: NominalRobot, measurements: Measurements) -> Fit:
    """Estimates axis deviations, base frame and probe frame.

    Raises:
        CalibrationError: too few poses, all poses alike, units or robot plainly wrong, no convergence.
    """
    _require_poses(robot, measurements)
    X_BF = nominal_flange_poses(robot, measurements.q_rad)
    problem = PoseProblem(robot, measurements, *frames.register(X_BF, measurements.p_ME, measurements.R_ME))
    names = poe.parameter_names(robot.num_joints)
    free = independent_columns(problem.evaluate(no_deviation(robot))[1], _order(names))
    held = {int(i): REDUNDANT for i in np.flatnonzero(~free)}
    prior_sigma = np.array([PRIOR_WIDTH * name.prior_scale if name.group == "axis" else np.inf for name in names])
    fit = _RobustFit(problem, free, prior_sigma)
    while unseen := fit.run():
        held.update(dict.fromkeys(unseen, NOT_SEEN))
    free, p, solution, sigma = fit.free, fit.p, fit.solution, fit.sigma

    n = robot.num_joints
    full = np.zeros((len(p), len(p)))
    full[np.ix_(free, free)] = covariance(solution, sigma)
    X_MB_nominal, X_FE_nominal = nominal_frames(robot, measurements)
    model = CalibratedModel(
        robot=robot,
        p=np.concatenate([p[: 4 * n], np.zeros(12)]),
        X_MB=problem.X_MB @ poe.frame_step(p[poe.base_slice(n)]),
        X_FE=problem.X_FE @ poe.frame_step(p[poe.tool_slice(n)]),
        X_MB_nominal=X_MB_nominal,
        X_FE_nominal=X_FE_nominal,
        base_is_given=measurements.X_MB_nominal is not None,
        tool_is_given=measurements.X_FE_nominal is not None,
    )
    return Fit(
        model=model,
        names=names,
        covariance=full,
        held=held,
        sigma_position_m=float(sigma[0]),
        sigma_orientation_rad=float(sigma[3]) if measurements.has_orientation else None,
        outlier=solution.weights == 0.0,
        residual=solution.residual,
        iterations=fit.iterations,
    )


class _RobustFit:
    """Robust fit, rejection of outliers, least squares; the noise is estimated all along."""

    def __init__(self, problem: PoseProblem, free: Array, prior_sigma: Array) -> None:
        self.problem, self.free, self.prior_sigma = problem, free.copy(), prior_sigma
        self.groups = [slice(k, k + 3) for k in range(0, problem.components, 3)]
        self.p, self.iterations = np.zeros(len(free)), 0
        residual = problem.evaluate(self.p)[0]
        self.sigma = np.concatenate([np.full(3, _median_noise(residual[:, group])) for group in self.groups])
        self.solution: Solution | None = None

    def run(self) -> list[int]:
        """Fits. Returns the parameters that turned out to be unseen and are free no longer: then run again."""
        for _ in range(ROBUST_ROUNDS):
            self._step(None, tolerance=NEAR_ENOUGH)
        if unseen := self._drop_unseen():
            return unseen
        inlier = self._inliers()
        for _ in range(MAX_ROUNDS):
            before, sigma_before = inlier, self.sigma
            self._step(inlier)
            inlier = self._inliers()
            # Only the ratio of position to orientation noise moves the solution.
            balanced = np.allclose(self.sigma / self.sigma[0], sigma_before / sigma_before[0], rtol=1e-3)
            if balanced and np.array_equal(inlier, before):
                break
        return self._drop_unseen()

    def _step(self, inlier: Array | None, **options: float) -> None:
        known = self.solution
        self.solution = minimise(
            self._evaluate,
            self.p[self.free],
            self.sigma,
            precision=self.prior_sigma[self.free] ** -2.0,
            inlier=inlier,
            evaluated=None if known is None else (known.residual, known.jacobian),
            **options,
        )
        self.p[self.free] = self.solution.x
        self.iterations += self.solution.iterations
        self.sigma = np.maximum(noise_components(self.solution, self.sigma, self.groups), NOISE_FLOOR)

    def _inliers(self) -> Array:
        """``(N,)`` False where a pose lies further off than noise of this size ever puts one."""
        N, m = self.solution.residual.shape
        limit = stats.chi2.isf(OUTLIER_PROBABILITY / N, m) * OUTLIER_MARGIN**2
        return np.sum((self.solution.residual / self.sigma) ** 2, axis=1) <= limit

    def _evaluate(self, x: Array) -> tuple[Array, Array]:
        p = self.p.copy()
        p[self.free] = x
        residual, J = self.problem.evaluate(p)
        return residual, J[:, :, self.free]

    def _drop_unseen(self) -> list[int]:
        """Holds, worst first, every parameter about which the wide prior says more than the data."""
        index, information = np.flatnonzero(self.free), np.linalg.inv(covariance(self.solution, self.sigma))
        dropped = []
        while True:
            uncertain = np.sqrt(np.diag(np.linalg.inv(information))) / self.prior_sigma[index]
            worst = int(np.argmax(uncertain))
            if uncertain[worst] <= np.sqrt(0.5):
                break
            dropped.append(int(index[worst]))
            information = np.delete(np.delete(information, worst, 0), worst, 1)
            index = np.delete(index, worst)
        if dropped:
            self.free[dropped], self.p[dropped], self.solution = False, 0.0, None
        return dropped


def _median_noise(residual: Array) -> float:
    """Noise per axis from the median length of residuals ``(N, 3)``; 1.538 is the median of a chi with 3 dof."""
    return max(float(np.median(np.linalg.norm(residual, axis=1))) / 1.538, NOISE_FLOOR)


def _order(names: tuple[poe.ParameterName, ...]) -> Array:
    """Frames first, then axes from the tool inwards: what is redundant is then held at the base of the robot."""
    rank = [-1 if name.joint is None else -name.joint + 1000 for name in names]
    return np.argsort(rank, kind="stable")


def _component_scale(measurements: Measurements) -> Array:
    """Brings rows of position (m) and orientation (rad) to a common size for the rank test."""
    return np.ones((1, 6 if measurements.has_orientation else 3, 1))


def _require_poses(robot: NominalRobot, measurements: Measurements) -> None:
    m = 6 if measurements.has_orientation else 3
    num_parameters = 4 * robot.num_joints + m
    needed, found = -(-num_parameters // m) + SPARE_POSES, int(measurements.groups().max(initial=-1)) + 1
    if found < needed:
        raise CalibrationError(
            f"too few poses for {num_parameters} parameters\n"
            f"  expected: at least {needed} different poses with {m} readings each\n  found:    {found}"
        )
    spread = np.ptp(measurements.q_rad, axis=0).max()
    if spread < LEAST_JOINT_SPREAD_RAD:
        raise CalibrationError(
            f"all poses are alike\n  expected: joints that move\n"
            f"  found:    no joint moves by more than {spread:.2g} rad over {found} poses"
        )
