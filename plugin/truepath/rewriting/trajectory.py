r"""A Drake trajectory of the joints, in memory, corrected: it goes through the same pipeline as a program.

Its joints at some moments are a program, which ``rewrite`` corrects and guards like any other. Between these moments
the correction :math:`\delta = q' - q` is a cubic spline with two continuous derivatives, added to the trajectory as it
is: what was smooth stays smooth, and what stood still at the ends does so. Moments are added until the tool, as
predicted, stays within the tolerance at all times that are looked at between them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import date
from typing import TYPE_CHECKING, Any

import numpy as np

from truepath.calibration import Calibration
from truepath.controller import controller_of
from truepath.correct import LIMIT_ROUNDING_RAD, MAX_CORRECTION_MM, correct
from truepath.errors import CorrectionError, InputError
from truepath.guards import Finding, condense
from truepath.lie import Array
from truepath.model import CalibratedModel, nominal_flange_poses
from truepath.rates import Rates, rate_findings
from truepath.rewriting.options import PATH_TOLERANCE_MM, RewriteOptions
from truepath.rewriting.pieces import Pieces, pieces_of
from truepath.rewriting.rewrite import RewrittenProgram, rewrite
from truepath.rewriting.sampled import SampledTrajectory
from truepath.robot import NominalRobot

if TYPE_CHECKING:
    from pydrake.trajectories import PiecewisePolynomial, Trajectory
    from scipy.interpolate import CubicSpline

    from truepath.posed_cell import Surroundings

LEAST_SAMPLES, MOST_SAMPLES = 9, 200_000
FIRST_STEP_RAD = 0.1  # a wave of 20 cycles a turn is seen by three samples
NEARLY = 0.8  # of the tolerance, above which a sample is added: a spline moves a little with every one
SHORTEST_S = 0.002  # between samples: what a controller can follow
BETWEEN = np.array([0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9])  # shares of the time between samples that are looked at
ROUNDS = 20
NUDGE_S = 1e-3
IN_LINE = re.compile(r"in line (\d+)")


@dataclass(frozen=True, eq=False)
class CorrectedTrajectory:
    """A corrected trajectory.

    Attributes:
        trajectory: joints to command, ``(n, 1)``, over the same time.
        time_s: ``(K,)`` of the samples at which it was corrected.
        rewritten: the samples as a corrected program; its line k is sample k.
        between_mm: largest predicted error of the tool at times between samples.
        tolerance_mm: for these.
        findings: warnings of the guards.
    """

    trajectory: PiecewisePolynomial
    time_s: Array
    rewritten: RewrittenProgram
    between_mm: float
    tolerance_mm: float
    findings: tuple[Finding, ...]

    def summary(self) -> dict[str, Any]:
        """What a machine wants to know, as plain JSON types."""
        kept = (
            *("displacement_mm", "predicted_error_before_mm", "predicted_error_after_mm"),
            *("outside_calibrated_region", "cell"),
        )
        whole = self.rewritten.summary()
        return {
            "schema": "truepath.trajectory/1",
            "trajectory": self.rewritten.file,
            "start_s": float(self.time_s[0]),
            "end_s": float(self.time_s[-1]),
            "samples": len(self.time_s),
            **{name: whole[name] for name in kept},
            "path": {"off_after_mm": self.between_mm, "tolerance_mm": self.tolerance_mm},
            "findings": [finding.to_json() for finding in self.findings],
            "warnings": self.warnings,
        }

    @property
    def warnings(self) -> list[str]:
        """Plain sentences, one for each kind of thing."""
        return [*self.correction_warnings, *condense(self.findings)]

    @property
    def correction_warnings(self) -> list[str]:
        """Those of the correction itself, with times."""
        return [_at_times(each, self.time_s) for each in self.rewritten.correction.warnings]


def correct_trajectory(
    trajectory: Trajectory,
    calibration: Calibration,
    *,
    tolerance_mm: float = PATH_TOLERANCE_MM,
    max_correction_mm: float = MAX_CORRECTION_MM,
    cell: str | None = None,
    surroundings: Surroundings | None = None,
    name: str = "trajectory",
    today: date | None = None,
) -> CorrectedTrajectory:
    """Corrects a trajectory of the nominal robot's joints for the calibrated one.

    Args:
        trajectory: n rows, rad, in the order of the robot's joints; of any kind.
        calibration: of the robot that will run it.
        tolerance_mm: how far the tool may be off between samples, as predicted.
        max_correction_mm: no sample may move further.
        cell: model of the cell in which collisions are looked for; None: nowhere.
        surroundings: the same in memory, as a host has it.
        name: for messages.
        today: in UTC, for the age of the calibration; default: today.

    Raises:
        InputError: not a trajectory of this robot's joints, or one that jumps.
        CorrectionError: a guard forbids it; with the time.
    """
    if not tolerance_mm > 0:
        raise InputError(
            "the path tolerance is no length", file=name, expected="more than 0 mm", found=str(tolerance_mm)
        )
    model = calibration.model
    pieces = pieces_of(trajectory, model.robot.num_joints, name)
    time_s = _samples(model, pieces, tolerance_mm, max_correction_mm, name)
    program = SampledTrajectory(name, time_s, pieces.values(time_s))
    options = RewriteOptions(
        path_tolerance_mm=None, max_correction_mm=max_correction_mm, cell=cell, surroundings=surroundings
    )
    try:
        rewritten = rewrite(program, calibration, controller_of(model.robot), options, today=today)
    except CorrectionError as error:
        raise _with_time(error, time_s) from None
    spline = _spline(model, pieces, time_s, rewritten.correction.q_rad, name)
    programmed = pieces.divided_at(time_s)
    corrected = programmed.plus(_powers(spline, programmed.breaks_s[:-1]))
    _require_limits(model.robot, corrected, name)
    off = float(_off_between(model, pieces, spline, time_s).max())
    findings = [_timed(finding, time_s) for finding in rewritten.findings]
    findings += _rates(model.robot, programmed, corrected)
    if off > tolerance_mm:
        message = f"the tool leaves its path by {off:.3f} mm between samples that are {1e3 * SHORTEST_S:g} ms apart"
        findings.append(Finding("warning", "path", None, message, off, tolerance_mm, "mm"))
    errors = [finding for finding in findings if finding.level == "error"]
    if errors:
        raise CorrectionError("; ".join(line.removeprefix("error: ") for line in condense(errors)), file=name)
    return CorrectedTrajectory(corrected.to_drake(), time_s, rewritten, off, tolerance_mm, tuple(findings))


def _samples(model: CalibratedModel, pieces: Pieces, tolerance_mm: float, max_correction_mm: float, file: str) -> Array:
    """Times ``(K,)`` at which the correction has to be known."""
    start, end = pieces.breaks_s[[0, -1]]
    travel = np.abs(np.diff(pieces.values(pieces.breaks_s), axis=0)).max(axis=1).sum()
    looked_at = np.linspace(start, end, 1000)
    travel = max(travel, np.abs(np.diff(pieces.values(looked_at), axis=0)).max(axis=1).sum())
    count = int(np.clip(np.ceil(travel / FIRST_STEP_RAD), LEAST_SAMPLES, MOST_SAMPLES))
    time_s = np.linspace(start, end, count)
    for _ in range(ROUNDS):
        q = _corrected(model, pieces.values(time_s), time_s, file, max_correction_mm)
        off = _off_between(model, pieces, _spline(model, pieces, time_s, q, file), time_s)
        wide = (off > NEARLY * tolerance_mm) & (np.diff(time_s) > 2 * SHORTEST_S)
        if not wide.any() or len(time_s) > MOST_SAMPLES:
            break
        time_s = np.union1d(time_s, 0.5 * (time_s[1:] + time_s[:-1])[wide])
    return time_s


def _corrected(
    model: CalibratedModel,
    q_rad: Array,
    time_s: Array,
    file: str,
    max_correction_mm: float,
    previous: Array | None = None,
) -> Array:
    """Corrected joints ``(K, n)``; what is wrong is told with its time."""
    try:
        return correct(model, q_rad, file=file, max_correction_mm=max_correction_mm, previous=previous).q_rad
    except CorrectionError as error:
        raise _with_time(error, time_s) from None


def _spline(model: CalibratedModel, pieces: Pieces, time_s: Array, q_corrected_rad: Array, file: str) -> CubicSpline:
    """The correction in between; at the ends it changes as fast as it should there, not at all where nothing moves."""
    from scipy.interpolate import CubicSpline

    q = pieces.values(time_s)
    correction, ends, step_s = q_corrected_rad - q, [0, -1], np.array([[NUDGE_S], [-NUDGE_S]])
    nudged = q[ends] + step_s * pieces.values(time_s[ends], 1)
    no_neighbours = np.array([-1, -1])
    change = _corrected(model, nudged, time_s[ends], file, np.inf, no_neighbours) - nudged - correction[ends]
    first, last = change / step_s
    return CubicSpline(time_s, correction, bc_type=((1, first), (1, last)))


def _powers(spline: CubicSpline, at_s: Array) -> Array:
    """``(P, 4, n)`` what multiplies the powers of the time after each of P moments, a cubic holding from there on."""
    return np.stack([spline(at_s, k) / factorial for k, factorial in enumerate((1, 1, 2, 6))], axis=1)


def _off_between(model: CalibratedModel, pieces: Pieces, spline: CubicSpline, time_s: Array) -> Array:
    """``(K - 1,)`` largest predicted error of the tool between samples, mm."""
    there = (time_s[:-1, None] + np.diff(time_s)[:, None] * BETWEEN).ravel()
    q = pieces.values(there)
    wanted = (model.goal_flange_poses(nominal_flange_poses(model.robot, q)) @ model.X_FE)[:, :3, 3]
    real = (model.flange_poses(q + spline(there)) @ model.X_FE)[:, :3, 3]
    return 1e3 * np.linalg.norm(real - wanted, axis=1).reshape(-1, len(BETWEEN)).max(axis=1)


def _rates(robot: NominalRobot, programmed: Pieces, corrected: Pieces) -> list[Finding]:
    """Of the trajectory itself, before and after."""
    shares = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    count = len(programmed.coefficients)
    piece, share = np.repeat(np.arange(count), len(shares)), np.tile(shares, count)
    before, after = (
        Rates(*(np.abs(part.at_shares(piece, share, k)).reshape(count, len(shares), -1).max(axis=1) for k in (1, 2)))
        for part in (programmed, corrected)
    )
    found = rate_findings(before, after, robot, np.arange(count) + 1)
    return [_timed(finding, programmed.breaks_s) for finding in found]


def _require_limits(robot: NominalRobot, corrected: Pieces, file: str) -> None:
    """Raises where a joint passes its limit between samples; at them it is looked at before."""
    shares = np.linspace(0, 1, 5)
    count = len(corrected.coefficients)
    piece, share = np.repeat(np.arange(count), len(shares)), np.tile(shares, count)
    q = corrected.at_shares(piece, share)
    beyond = (q < robot.lower_rad - LIMIT_ROUNDING_RAD) | (q > robot.upper_rad + LIMIT_ROUNDING_RAD)
    if beyond.any():
        k, i = np.argwhere(beyond)[0]
        time_s = corrected.breaks_s[piece[k]] + share[k] * np.diff(corrected.breaks_s)[piece[k]]
        raise CorrectionError(
            "the corrected joint passes its limit between samples",
            file=file,
            column=f"q{i + 1} ({robot.joint_names[i]})",
            expected=f"{robot.lower_rad[i]:.6f} to {robot.upper_rad[i]:.6f} rad",
            found=f"{q[k, i]:.6f} rad at {time_s:.3f} s",
        )


def _timed(finding: Finding, time_s: Array) -> Finding:
    """The same about a time instead of a line."""
    if finding.line is None:
        return finding
    return replace(finding, line=None, message=f"at {time_s[finding.line - 1]:.3f} s: {finding.message}")


def _with_time(error: CorrectionError, time_s: Array) -> CorrectionError:
    when = "" if error.line is None else f" at {time_s[error.line - 1]:.3f} s"
    return CorrectionError(
        _at_times(error.problem, time_s) + when,
        file=error.file,
        column=error.column,
        expected=error.expected,
        found=error.found,
    )


def _at_times(text: str, time_s: Array) -> str:
    """A sentence about lines as one about times."""
    return IN_LINE.sub(lambda match: f"at {time_s[int(match[1]) - 1]:.3f} s", text)
