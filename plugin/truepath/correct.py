"""Correction: joints that put the calibrated robot where the program wants the tool, or a clear refusal."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from truepath.errors import CorrectionError, InputError
from truepath.iso9283 import ErrorStatistics
from truepath.kinematics.corrected_joints import CorrectedJoints, corrected_joints
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.networks_along import NetworksAlong
from truepath.region import Region

MAX_CORRECTION_MM = 5.0
MAX_JOINT_CORRECTION_RAD = 0.15
MAX_JUMP_RAD = 0.02
LIMIT_ROUNDING_RAD = 1e-9  # a limit written with few decimals is still that limit
NEAR_SINGULAR = 0.03
WEIGHT_DIGITS = 6
FORWARD_TOLERANCE_M, FORWARD_TOLERANCE_RAD = 1e-6, 1e-6


@dataclass(frozen=True)
class Correction:
    """Corrected joints of a path and what they are expected to bring.

    Attributes:
        q_rad: ``(N, n)`` corrected joints.
        displacement_mm: ``(N,)`` how far each commanded flange position moved, in nominal kinematics.
        error_before_mm, error_after_mm: ``(N,)`` predicted distance of the tool point from where it should be.
        outside: ``(N,)`` True where the calibration data did not reach.
        networks: how far they differ, and where they are faded; None where the calibration has none.
        warnings: plain sentences for the user.
    """

    q_rad: Array
    displacement_mm: Array
    error_before_mm: Array
    error_after_mm: Array
    outside: Array
    networks: NetworksAlong | None = None
    warnings: list[str] = field(default_factory=list)

    def summary(self) -> dict[str, Any]:
        """What a machine wants to know, as plain JSON types."""

        def statistics(values: Array) -> dict[str, float]:
            return vars(ErrorStatistics.of(values)).copy()

        return {
            "schema": "truepath.correction/1",
            "waypoints": len(self.q_rad),
            "displacement_mm": statistics(self.displacement_mm),
            "predicted_error_before_mm": statistics(self.error_before_mm),
            "predicted_error_after_mm": statistics(self.error_after_mm),
            "outside_calibrated_region": int(self.outside.sum()),
            "network": None if self.networks is None else _network(self.networks),
            "warnings": self.warnings,
        }


def correct(
    model: CalibratedModel,
    q_rad: Array,
    *,
    region: Region | None = None,
    line: Array | None = None,
    file: str = "path",
    max_correction_mm: float = MAX_CORRECTION_MM,
    previous: Array | None = None,
) -> Correction:
    """Corrects a path given as nominal joints.

    Args:
        model: the calibrated robot.
        q_rad: ``(N, n)`` programmed joints; what they reach in nominal kinematics is what the program means.
        region: where the calibration was measured; waypoints outside are reported.
        line: ``(N,)`` lines of the waypoints in their file, for messages.
        file: name for messages.
        max_correction_mm: no commanded position may move further.
        previous: ``(N,)`` index of the waypoint before each, -1 where there is none; None: the one in the row before.

    Raises:
        CorrectionError: a limit passed, no convergence, a jump against a neighbour, too large a
            correction; with the line of the first waypoint concerned.
    """
    q_rad = np.atleast_2d(np.asarray(q_rad, float))
    line = np.arange(len(q_rad)) + 1 if line is None else line
    robot = model.robot
    if q_rad.shape[1] != robot.num_joints:
        raise InputError("the path has another number of joints", file=file, expected=str(robot.num_joints))
    if robot.num_joints < 6:
        raise InputError(
            f"{robot.name} has {robot.num_joints} joints", expected="six or more: a pose has six degrees of freedom"
        )
    if len(q_rad) == 0:
        raise InputError("the path has no waypoints", file=file)
    lower, upper = robot.lower_rad - LIMIT_ROUNDING_RAD, robot.upper_rad + LIMIT_ROUNDING_RAD
    _refuse(
        ~((q_rad >= lower) & (q_rad <= upper)),  # in this way round for what is no number
        "the program itself passes a joint limit",
        q_rad,
        model,
        line,
        file,
    )
    solution = _solve(model, q_rad, line, file)
    solution_q, displacement_mm = solution.q_rad, solution.displacement_mm
    _refuse(
        (solution_q < lower) | (solution_q > upper),
        "the corrected joint passes its limit",
        solution_q,
        model,
        line,
        file,
    )
    _refuse_jumps(q_rad, solution_q, robot.joint_names, line, file, previous)
    too_far = ~(displacement_mm <= max_correction_mm)
    if too_far.any():
        k = int(np.argmax(too_far))
        raise CorrectionError(
            "the correction is larger than allowed",
            file=file,
            line=int(line[k]),
            expected=f"{max_correction_mm:g} mm at most (--max-correction-mm)",
            found=f"{displacement_mm[k]:.3f} mm here, up to {displacement_mm.max():.3f} mm in the whole path",
        )
    outside = np.zeros(len(q_rad), bool) if region is None else ~region.contains(q_rad)
    networks = None if model.residual is None else NetworksAlong.of(model.residual, solution_q)
    return Correction(
        q_rad=solution_q,
        displacement_mm=displacement_mm,
        error_before_mm=solution.error_before_mm,
        error_after_mm=solution.error_after_mm,
        outside=outside,
        networks=networks,
        warnings=_warnings(outside, networks, solution.smallest_singular_value, line),
    )


def _solve(model: CalibratedModel, q_rad: Array, line: Array, file: str) -> CorrectedJoints:
    solution = corrected_joints(model, q_rad, exact_below=NEAR_SINGULAR)
    ok = (solution.position_error_m < FORWARD_TOLERANCE_M) & (solution.angle_error_rad < FORWARD_TOLERANCE_RAD)
    changes = np.abs(solution.q_rad - q_rad)
    if not (ok.all() and (changes < MAX_JOINT_CORRECTION_RAD).all()):
        change = changes.max(axis=1)
        k = int(np.argmin(ok & (change < MAX_JOINT_CORRECTION_RAD)))
        where = f"distance to singularity {solution.smallest_singular_value[k]:.3g}"
        if ok[k]:
            raise CorrectionError(
                "the correction leaves the posture",
                file=file,
                line=int(line[k]),
                expected=f"no joint moving by {np.degrees(MAX_JOINT_CORRECTION_RAD):.1f} deg or more",
                found=f"{np.degrees(change[k]):.2f} deg; {where}",
            )
        raise CorrectionError(
            "no correction was found near the programmed joints",
            file=file,
            line=int(line[k]),
            expected="the tool within 1 um and 1 urad of where it should be",
            found=f"{1e6 * solution.position_error_m[k]:.3g} um, {1e6 * solution.angle_error_rad[k]:.3g} urad; {where}",
        )
    return solution


def _refuse(beyond: Array, problem: str, q_rad: Array, model: CalibratedModel, line: Array, file: str) -> None:
    if beyond.any():
        k, i = np.argwhere(beyond)[0]
        robot = model.robot
        raise CorrectionError(
            problem,
            file=file,
            line=int(line[k]),
            column=f"q{i + 1} ({robot.joint_names[i]})",
            expected=f"{robot.lower_rad[i]:.6f} to {robot.upper_rad[i]:.6f} rad",
            found=f"{q_rad[k, i]:.6f} rad",
        )


def _refuse_jumps(
    programmed: Array, corrected: Array, names: tuple[str, ...], line: Array, file: str, previous: Array | None
) -> None:
    """The correction must vary smoothly: what it adds to a step between neighbours is bounded."""
    before = np.arange(len(programmed)) - 1 if previous is None else previous
    at = np.flatnonzero(before >= 0)
    added = np.abs((corrected - programmed)[at] - (corrected - programmed)[before[at]])
    # Neighbours far apart may differ more: the correction is a smooth function of the joints.
    step = np.abs(programmed[at] - programmed[before[at]]).max(axis=1, keepdims=True, initial=0.0)
    allowed = MAX_JUMP_RAD + 0.1 * step
    if (added > allowed).any():
        k, i = np.argwhere(added > allowed)[0]
        raise CorrectionError(
            "the correction jumps between neighbouring waypoints",
            file=file,
            line=int(line[at[k]]),
            column=f"q{i + 1} ({names[i]})",
            expected=f"a change of {np.degrees(float(allowed[k, 0])):.2f} deg at most",
            found=f"{np.degrees(added[k, i]):.2f} deg",
        )


def _network(networks: NetworksAlong) -> dict[str, Any]:
    spread = networks.spoken_mm
    return {
        "spread_mm": {"mean": float(spread.mean()), "max": float(spread.max())} if len(spread) else None,
        "faded_partly": int((networks.faded & ~networks.silent).sum()),
        "faded_out": int(networks.silent.sum()),
        "weight": networks.weight.round(WEIGHT_DIGITS).tolist(),
    }


def _warnings(outside: Array, networks: NetworksAlong | None, singular: Array, line: Array) -> list[str]:
    warnings = []
    if outside.any():
        warnings.append(
            f"{int(outside.sum())} of {len(outside)} waypoints lie outside the joints that were measured "
            f"(first in line {int(line[np.argmax(outside)])}): there the kinematics is extrapolated, and named effects "
            "fade out joint by joint"
        )
    if networks is not None and networks.faded.any():
        warnings.append(_where_faded(networks, line))
    near = singular < NEAR_SINGULAR
    if near.any():
        warnings.append(
            f"{int(near.sum())} waypoints are close to a singularity (first in line {int(line[np.argmax(near)])}, "
            f"smallest singular value {singular.min():.3g}): small errors need large joint motions there"
        )
    return warnings


def _where_faded(networks: NetworksAlong, line: Array) -> str:
    count, out = int(networks.faded.sum()), int(networks.silent.sum())
    where = f"at {count} of {len(line)} waypoints (first in line {int(line[np.argmax(networks.faded)])})"
    fact = f"the networks are faded {where}" + (f", at {out} of them to nothing" if out else "")
    if out == count:
        fact = f"the networks are faded out {where}"
    told = f"what only the networks know is {networks.corrected} there"
    return f"{fact}: too few poses were measured near these, and {told}"
