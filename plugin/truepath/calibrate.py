"""Kinematic calibration: POE deviations and frames by Levenberg-Marquardt on CasADi's exact derivatives.

The steps: closed-form registration of the frames, a robust fit that finds gross errors, rejection of
these, a least-squares fit of the rest in which the noise is estimated too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from truepath import frames, lie, poe
from truepath.choose import choose
from truepath.context import Context
from truepath.effect_fit import EffectFit
from truepath.effects import effect_named
from truepath.errors import CalibrationError
from truepath.identifiability import independent_columns
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.model import CalibratedModel, no_deviation, nominal_flange_poses
from truepath.poe_symbolic import PoseProblem
from truepath.robot import NominalRobot
from truepath.robust_fit import RobustFit

SPARE_POSES = 3
PRIOR_WIDTH = 3.0  # times the plausible size: wide enough not to matter where the data says anything
REDUNDANT = "redundant: other free parameters have the same effect"
BARELY_SEEN = f"barely seen: kept plausible (within {PRIOR_WIDTH:.0f} mm or mrad) more by assumption than by the data"
LEAST_JOINT_SPREAD_RAD = 1e-3


@dataclass(frozen=True)
class Fit:
    """What a calibration found. Shapes: N poses, k = 4 n + 12 parameters, m = 3 or 6 components.

    Attributes:
        model: the robot as it is.
        names: k parameter names, in the order of model.p.
        covariance: ``(k, k)``, zero rows for held parameters; of the frames it tells about small steps.
        held: number of a parameter to the reason why it stays at nominal.
        barely_seen: numbers of parameters about which the wide prior says more than the data. They stay free,
            so that the uncertainty of all others includes theirs.
        sigma_position_m, sigma_orientation_rad: noise per axis, estimated; the latter None for 3D data.
        outlier: ``(N,)`` True for poses left out.
        residual: ``(N, m)`` predicted minus measured, in the measurement frame.
        iterations: evaluations of the model by the kinematic fit.
        log_evidence: log marginal likelihood of the poses that are no outliers, to compare sets of effects.
    """

    model: CalibratedModel
    names: tuple[poe.ParameterName, ...]
    covariance: Array
    held: dict[int, str]
    barely_seen: tuple[int, ...]
    sigma_position_m: float
    sigma_orientation_rad: float | None
    outlier: Array
    residual: Array
    iterations: int
    log_evidence: float

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


@dataclass(frozen=True)
class KinematicFit:
    """The kinematics of a robot fitted to a data set, from which fits with effects go on.

    Attributes:
        robot, measurements: what was fitted to what.
        fit: the robust fit.
        context: circumstances of its poses.
        names: of its parameters.
        held: number of a parameter to the reason why it stays at nominal.
    """

    robot: NominalRobot
    measurements: Measurements
    context: Context
    fit: RobustFit
    names: tuple[poe.ParameterName, ...]
    held: dict[int, str]


@threadpool_limits.wrap(limits=1)  # threads on matrices of this size cost more than they bring
def fit_kinematics(robot: NominalRobot, measurements: Measurements, context: Context | None = None) -> KinematicFit:
    """Estimates axis deviations, base frame and probe frame.

    Args:
        robot: nominal robot.
        measurements: the data.
        context: circumstances of its poses, if they are part of a larger campaign.

    Raises:
        CalibrationError: too few poses, all poses alike, units or robot plainly wrong, no convergence.
    """
    _require_poses(robot, measurements)
    X_BF = nominal_flange_poses(robot, measurements.q_rad)
    X_MB, X_FE = frames.register(X_BF, measurements.p_ME, measurements.R_ME)
    frames.require_variety(X_BF, X_FE, measurements.has_orientation)
    problem = PoseProblem(robot, measurements, X_MB, X_FE)
    names = poe.parameter_names(robot.num_joints)
    free = free_parameters(problem.evaluate(no_deviation(robot))[1], names)
    held = {int(i): REDUNDANT for i in np.flatnonzero(~free)}
    fit = RobustFit(problem, free, prior_widths(names))
    fit.run()
    return KinematicFit(robot, measurements, context or Context.of(measurements), fit, names, held)


@threadpool_limits.wrap(limits=1)
def calibrate(robot: NominalRobot, measurements: Measurements, effects: Sequence[str] = ()) -> Fit:
    """Estimates axis deviations, base frame and probe frame, and the sizes of named effects.

    Args:
        robot: nominal robot.
        measurements: the data.
        effects: names from ``effects.EFFECTS``; how much of each there is, joint by joint, is learnt, and what the
            data does not speak for is left out.

    Raises:
        CalibrationError: too few poses, all poses alike, units or robot plainly wrong, no convergence.
        InputError: an unknown effect.
    """
    names = [effect_named(name).name for name in effects]
    kinematic = fit_kinematics(robot, measurements)
    return finish(kinematic, choose(kinematic.fit, kinematic.context, names, nameless=False).fit)


def finish(kinematic: KinematicFit, found: EffectFit) -> Fit:
    """The result of a fit, with its frames put together."""
    robot, measurements, fit = kinematic.robot, kinematic.measurements, kinematic.fit
    n, p, problem = robot.num_joints, found.p, fit.problem
    full = np.zeros((len(p), len(p)))
    full[np.ix_(fit.free, fit.free)] = found.covariance
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
        effects=found.effects,
        payload_kg=0.0 if measurements.payload_kg is None else float(np.median(measurements.payload_kg)),
    )
    return Fit(
        model=model,
        names=kinematic.names,
        covariance=full,
        held=kinematic.held,
        barely_seen=tuple(np.flatnonzero(np.sqrt(np.diag(full)) > np.sqrt(0.5) * fit.prior_sigma).tolist()),
        sigma_position_m=float(found.sigma[0]),
        sigma_orientation_rad=float(found.sigma[3]) if measurements.has_orientation else None,
        outlier=~found.inlier,
        residual=found.residual,
        iterations=fit.iterations,
        log_evidence=found.log_evidence,
    )


def free_parameters(jacobian: Array, names: tuple[poe.ParameterName, ...]) -> Array:
    """``(k,)`` True for the parameters that poses with this Jacobian ``(N, m, k)`` can tell from each other."""
    return independent_columns(jacobian, _rank(names))


def prior_widths(names: tuple[poe.ParameterName, ...]) -> Array:
    """``(k,)`` widths of the priors about nominal; infinite for the frames."""
    return np.array([PRIOR_WIDTH * name.prior_scale if name.group == "axis" else np.inf for name in names])


def _rank(names: tuple[poe.ParameterName, ...]) -> Array:
    """Frames first, then axes from the tool inwards: what is redundant is then held at the base of the robot."""
    return np.array([-np.inf if name.joint is None else -name.joint for name in names])


def _require_poses(robot: NominalRobot, measurements: Measurements) -> None:
    m = 6 if measurements.has_orientation else 3
    num_parameters = 4 * robot.num_joints + m
    needed = -(-num_parameters // m) + SPARE_POSES
    found = len(np.unique(np.round(measurements.q_rad, 6), axis=0))
    spread = np.ptp(measurements.q_rad, axis=0).max() if len(measurements) else np.inf
    if len(measurements) > 1 and spread < LEAST_JOINT_SPREAD_RAD:
        raise CalibrationError(
            f"all poses are alike\n  expected: joints that move\n"
            f"  found:    no joint moves by more than {spread:.2g} rad over {len(measurements)} rows"
        )
    if found < needed:
        raise CalibrationError(
            f"too few poses for {num_parameters} parameters\n"
            f"  expected: at least {needed} different poses with {m} readings each\n  found:    {found}"
        )
