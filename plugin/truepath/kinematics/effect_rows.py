"""What the named effects of a calibration do to the arm, for rows of poses of which only the joints are known."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import lru_cache

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects import EFFECTS
from truepath.effects.base import FittedTerm, Term, constant_names, fading_limits, pose_function
from truepath.effects.readings import readings
from truepath.kinematics.blocks import blocks
from truepath.kinematics.gravity import gravity_moments
from truepath.kinematics.vector_program import VectorProgram
from truepath.lie import Array
from truepath.motions import COMPONENTS, OF_ONE_JOINT, Moves
from truepath.region import fade
from truepath.robot import NominalRobot

MOMENTS = ("moment_x", "moment_y", "gravity_torque")
# Rows of a joint: its error, then what the body that its axis carries does (x, y, z, rx, ry).
OF_A_JOINT = 1 + len(COMPONENTS[Moves.AXIS])
FEW = 3  # rows
Limits = tuple[float, float]


class EffectPrograms:
    """What is to be computed, whatever the number of poses.

    Args:
        robot: nominal robot.
        effects: those that move joints, axes or the lengths of the robot; others are left out.
        payload_kg: what the robot carries beyond its model.
        turn: n angles by which the frame of each axis is turned about its z to be that of its motions, rad.

    Attributes:
        strain: by how much all lengths of the robot are longer.
        moves_joints: whether any joint or axis moves.
        moved_axes: numbers of the axes that do, from 0.
    """

    def __init__(
        self, robot: NominalRobot, effects: Sequence[FittedTerm], payload_kg: float, turn: Sequence[float]
    ) -> None:
        n = self.num_joints = robot.num_joints
        self.strain = sum((_strain(robot, part) for part in effects if part.term.moves is Moves.ROBOT_LENGTHS), 0.0)
        parts = [part for part in effects if part.term.moves in OF_ONE_JOINT]
        self.moves_joints = bool(parts)
        self.moved_axes = sorted({_joint(part.term) for part in parts if part.term.moves is Moves.AXIS})
        loaded = sorted({(_joint(part.term), name) for part in parts for name in part.term.inputs if name in MOMENTS})
        symbols = ca.SX.sym("x", 3 * n + len(loaded))
        sines = {i: (n + i, 2 * n + i) for i in range(n)}
        moments = gravity_moments(robot, symbols[n : 2 * n], symbols[2 * n : 3 * n], payload_kg) if loaded else []
        weights = ca.vertcat(*(moments[i][MOMENTS.index(name)] for i, name in loaded)) if loaded else ca.SX(0, 1)
        self.weigh = VectorProgram(symbols, weights, sines)
        of_place = {place: k for k, place in enumerate(loaded)}

        def value(term: Term, name: str) -> ca.SX | float:
            if name in MOMENTS:
                k = of_place[_joint(term), name]
                row = int(self.weigh.row[k])
                return symbols[3 * n + row] if row >= 0 else float(self.weigh.constant[k])
            if name == "theta" or name[0] == "q":
                return symbols[_joint(term) if name == "theta" else int(name[1:]) - 1]
            return _unrecorded(robot, term, name)

        groups: dict[tuple[int, Limits | None], list[FittedTerm]] = defaultdict(list)
        for part in parts:
            groups[_joint(part.term), fading_limits(part.term)].append(part)
        sums = [
            (joint, limits, _Sum(own, [_derivative(part.term, value) for part in own], turn[joint], symbols, sines))
            for (joint, limits), own in groups.items()
        ]
        # What neither changes nor fades is added once; of the others, those with most rows first for each joint.
        self.constant = np.zeros((n, OF_A_JOINT, 1))
        for joint, limits, one in sums:
            if limits is None:
                self.constant[joint, : one.rows] += one.constant
        self.sums = sorted(
            (entry for entry in sums if entry[1] is not None or entry[2].program.num_rows),
            key=lambda entry: (entry[0], -entry[2].rows),
        )


@lru_cache(maxsize=8)
def effect_programs(
    robot: NominalRobot, effects: tuple[FittedTerm, ...], payload_kg: float, turn: tuple[float, ...]
) -> EffectPrograms:
    """The same, known again when the same calibration comes again; to take the formulas apart takes a while."""
    return EffectPrograms(robot, effects, payload_kg, turn)


class EffectRows:
    """Joint errors and axis motions of N poses.

    Attributes:
        programs: of the calibration.
        angles: ``(3 n, N)`` memory for the joint angles that were commanded, their sines and their cosines.
        motions: ``(n, 6, N)`` error of each joint, rad, and motion (x, y, z, rx, ry) of what its axis carries, m
            and rad; overwritten by each call.
    """

    def __init__(self, programs: EffectPrograms, N: int) -> None:
        n = programs.num_joints
        self.programs = programs
        self.motions, self._part = np.zeros((n, OF_A_JOINT, N)), np.empty((OF_A_JOINT, N))
        x = np.zeros((3 * n + programs.weigh.num_rows, N))
        self.angles = x[: 3 * n]
        self._weigh = programs.weigh.bound_to(x, x[3 * n :])
        sums = programs.sums
        basis = np.empty((max((one.program.num_rows for *_, one in sums), default=0), N))  # one behind the other
        self._fills = [(one.program.bound_to(x, basis), basis[: one.program.num_rows]) for *_, one in sums]
        self._blocks = blocks(N)
        constant = programs.constant
        self._shifted = OF_A_JOINT if constant[:, 1:].any() else int(constant.any())

    def __call__(self) -> None:
        """Evaluates them for the joints in ``angles`` now."""
        self._weigh()
        if self._shifted:
            self.motions[:, : self._shifted] = 0.0
        before = -1
        for (joint, limits, one), (fill, basis) in zip(self.programs.sums, self._fills, strict=True):
            fill()
            rows = one.rows
            out = self._part[:rows] if joint == before else self.motions[joint, :rows]
            if one.few is None:
                for own, used, coefficients in one.products:
                    for columns in self._blocks:
                        np.matmul(coefficients, basis[used, columns], out=out[own, columns])
            else:
                out[...] = 0.0
                for row, size in enumerate(one.few):
                    out[0] += np.multiply(basis[row], size, out=out[1])
                out[1] = 0.0
            if limits is not None:
                if one.constant.any():
                    out += one.constant
                theta = self.angles[joint]
                if not (theta.min() >= limits[0] and theta.max() <= limits[1]):  # else the weight is 1
                    out *= fade(theta, *limits)
            if joint == before:
                self.motions[joint, :rows] += out
            before = joint
        if self._shifted:
            self.motions[:, : self._shifted] += self.programs.constant[:, : self._shifted]


class _Sum:
    """Motions of one joint that fade beyond the same limits: coefficients times the rows of a program.

    Attributes:
        program: of what the terms depend on.
        rows: 6, or 2 where the axis carries nothing about: the second is zero then.
        products: which of these rows, from which rows of the program, by which coefficients.
        constant: ``(rows, 1)`` what is added.
        few: coefficients of the error of the joint, where it is not worth while to multiply matrices.
    """

    def __init__(
        self,
        terms: Sequence[FittedTerm],
        derivatives: Sequence[ca.SX],
        turn: float,
        symbols: ca.SX,
        sines: dict[int, tuple[int, int]],
    ) -> None:
        entries = [(k, r, c) for k, J in enumerate(derivatives) for c in range(J.shape[1]) for r in range(J.shape[0])]
        self.program = VectorProgram(symbols, ca.vertcat(*(ca.vec(ca.densify(J)) for J in derivatives)), sines)
        C, constant = np.zeros((OF_A_JOINT, self.program.num_rows)), np.zeros((OF_A_JOINT, 1))
        for (k, r, c), row, number in zip(entries, self.program.row, self.program.constant, strict=True):
            value, moved = float(terms[k].values[c]), r + int(terms[k].term.moves is Moves.AXIS)
            if row >= 0:
                C[moved, row] += value
            else:
                constant[moved] += value * number
        C[1:], constant[1:] = _about_z(-turn) @ C[1:], _about_z(-turn) @ constant[1:]
        self.rows = OF_A_JOINT if any(part.term.moves is Moves.AXIS for part in terms) else 2
        self.constant = constant[: self.rows]
        # In two parts: the motion of the axis needs fewer rows. None has one row only: products of a matrix and a
        # vector would use several threads.
        self.products = [_product(C, own) for own in (slice(0, 2), slice(2, OF_A_JOINT)) if own.start < self.rows]
        self.few = C[0].tolist() if self.rows == 2 and C.shape[1] <= FEW else None


def _product(C: Array, own: slice) -> tuple[slice, slice, Array]:
    used = np.flatnonzero(C[own].any(axis=0))
    needed = slice(int(used[0]), int(used[-1]) + 1) if len(used) else slice(0, 0)
    return own, needed, np.ascontiguousarray(C[own, needed])


def _joint(term: Term) -> int:
    """From 0."""
    assert term.joint is not None
    return term.joint - 1


def _derivative(term: Term, value: Callable[[Term, str], ca.SX | float]) -> ca.SX:
    """What a term moves per unit of each of its parameters, ``(c, k)``."""
    values = [value(term, name) for name in term.inputs]
    constants = [term.constant(name) for name in constant_names(term)]
    return ca.SX(pose_function(EFFECTS[term.effect], term)(*(values or [0.0]), *constants))


def _strain(robot: NominalRobot, part: FittedTerm) -> float:
    """Of poses of which no circumstance is known."""
    derivative = _derivative(part.term, lambda term, name: _unrecorded(robot, term, name))
    return float((np.array(ca.DM(derivative), float) @ part.values)[0])


def _unrecorded(robot: NominalRobot, term: Term, name: str) -> float:
    """What a circumstance is taken for where nobody recorded it."""
    nowhere = Context(np.zeros((1, robot.num_joints)))
    return float(readings(robot, nowhere, (name,), term.joint, dict(term.constants))[0][0])


def _about_z(angle: float) -> Array:
    """``(5, 5)`` turns shifts (x, y, z) and tilts (rx, ry) about z."""
    turned = np.eye(5)
    c, s = np.cos(angle), np.sin(angle)
    turned[:2, :2] = turned[3:, 3:] = [[c, -s], [s, c]]
    return turned
