"""A trajectory of any kind as polynomials between breaks, to which something smooth can be added exactly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array

if TYPE_CHECKING:
    from pydrake.trajectories import PiecewisePolynomial, Trajectory

DEGREE = 5  # holds what planners and interpolation make: cubics, quintics, B-splines of order 4 to 6
SAME_RAD = 1e-10  # between a trajectory and its polynomial
JUMP_RAD, SHORTEST_S = 1e-6, 1e-9
LOOKED_AT, BISECTIONS = 4097, 45
CHECKED = np.array([0.07, 0.21, 0.38, 0.59, 0.74, 0.93])
# Chebyshev's points with both ends: what is continuous stays so, to the last digit.
NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
FROM_NODES = np.linalg.inv(np.vander(NODES, increasing=True))


@dataclass(frozen=True, eq=False)
class Pieces:
    """P polynomials of n joints.

    Attributes:
        breaks_s: ``(P + 1,)``.
        coefficients: ``(P, DEGREE + 1, n)`` of powers of the share of each piece that is gone.
    """

    breaks_s: Array
    coefficients: Array

    def values(self, time_s: Array, derivative: int = 0) -> Array:
        """``(K, n)`` joints at times ``(K,)`` or a derivative by time; at a break of the piece after it."""
        piece = np.clip(np.searchsorted(self.breaks_s, time_s, side="right") - 1, 0, len(self.coefficients) - 1)
        length = np.diff(self.breaks_s)[piece]
        share = (time_s - self.breaks_s[piece]) / length
        return self.at_shares(piece, share, derivative)

    def at_shares(self, piece: Array, share: Array, derivative: int = 0) -> Array:
        """The same at shares ``(K,)`` of pieces ``(K,)``."""
        power = np.arange(DEGREE + 1)
        falling = np.prod([np.maximum(power - k, 0) for k in range(derivative)], axis=0) * np.ones(len(power))
        powers = falling * share[:, None] ** np.maximum(power - derivative, 0)
        scale = np.diff(self.breaks_s)[piece] ** derivative
        return np.einsum("kp,kpn->kn", powers, self.coefficients[piece]) / scale[:, None]

    def divided_at(self, time_s: Array) -> Pieces:
        """The same with more breaks, at times ``(K,)``."""
        breaks = np.union1d(self.breaks_s, time_s)
        piece = np.searchsorted(self.breaks_s, 0.5 * (breaks[1:] + breaks[:-1]), side="right") - 1
        there = breaks[:-1, None] + np.diff(breaks)[:, None] * NODES
        share = (there - self.breaks_s[piece, None]) / np.diff(self.breaks_s)[piece, None]
        values = self.at_shares(np.repeat(piece, len(NODES)), share.ravel())
        return Pieces(breaks, FROM_NODES @ values.reshape(len(piece), len(NODES), -1))

    def plus(self, coefficients: Array) -> Pieces:
        """With polynomials ``(P, D + 1, n)`` of lower degree added, by powers of the time in each piece, 1/s^k."""
        sum_of_both = self.coefficients.copy()
        count = coefficients.shape[1]
        sum_of_both[:, :count] += coefficients * np.diff(self.breaks_s)[:, None, None] ** np.arange(count)[:, None]
        return Pieces(self.breaks_s, sum_of_both)

    def to_drake(self) -> PiecewisePolynomial:
        """As Drake has it; with n rows."""
        from pydrake.polynomial import Polynomial
        from pydrake.trajectories import PiecewisePolynomial

        length = np.diff(self.breaks_s)[:, None, None]
        by_time = self.coefficients / length ** np.arange(DEGREE + 1)[:, None]
        matrices = [np.array([[Polynomial(row)] for row in piece.T]) for piece in by_time]
        return PiecewisePolynomial(matrices, self.breaks_s)


def pieces_of(trajectory: Trajectory, num_joints: int, file: str) -> Pieces:
    """The polynomials of a trajectory; of one that is none, polynomials within 1e-10 rad of it.

    Raises:
        InputError: not a trajectory of so many joints, no duration, no numbers, or a jump.
    """
    if trajectory.rows() != num_joints or trajectory.cols() != 1:
        raise InputError(
            "the trajectory is not one of this robot's joints",
            file=file,
            expected=f"{num_joints} rows, 1 column",
            found=f"{trajectory.rows()} rows, {trajectory.cols()} columns",
        )
    start, end = trajectory.start_time(), trajectory.end_time()
    if not (np.isfinite([start, end]).all() and end > start):
        raise InputError("the trajectory has no duration", file=file, found=f"{start} s to {end} s")
    begin, finish = _begins_and_ends(np.clip(_breaks(trajectory), start, end))
    kept: list[tuple[Array, Array]] = []
    while len(begin):
        there = begin[:, None] + (finish - begin)[:, None] * np.concatenate([NODES, CHECKED])
        there[:, len(NODES) - 1] = finish
        values = np.asarray(trajectory.vector_values(there.ravel())).T.reshape(*there.shape, num_joints)
        if not np.isfinite(values).all():
            k = int(np.argmin(np.isfinite(values).reshape(len(begin), -1).all(axis=1)))
            raise InputError("the trajectory is no number", file=file, expected="finite joints", found=_when(begin[k]))
        coefficients = FROM_NODES @ values[:, : len(NODES)]
        told = CHECKED[:, None] ** np.arange(DEGREE + 1) @ coefficients
        fits = (np.abs(told - values[:, len(NODES) :]) <= SAME_RAD).all(axis=(1, 2))
        short = ~fits & (finish - begin < SHORTEST_S)
        steps = np.abs(values[:, len(NODES) - 1] - values[:, 0]).max(axis=1)
        if (short & (steps > JUMP_RAD)).any():
            k = int(np.argmax(short & (steps > JUMP_RAD)))
            raise InputError(
                "the trajectory jumps",
                file=file,
                expected="joints without a leap",
                found=f"{steps[k]:.3g} rad {_when(begin[k])}",
            )
        fits |= short  # a kink, of which this is all that is left
        kept.append((begin[fits], coefficients[fits]))
        middle = 0.5 * (begin + finish)[~fits]
        begin, finish = np.concatenate([begin[~fits], middle]), np.concatenate([middle, finish[~fits]])
    starts, coefficients = (np.concatenate(part) for part in zip(*kept, strict=True))
    order = np.argsort(starts)
    return Pieces(np.append(starts[order], end), coefficients[order])


def _begins_and_ends(breaks: Array) -> tuple[Array, Array]:
    breaks = np.unique(breaks)
    breaks = np.append(breaks[:-1][np.diff(breaks) > SHORTEST_S], breaks[-1])
    return breaks[:-1], breaks[1:]


def _breaks(trajectory: Trajectory) -> Array:
    """Where polynomials may meet, as far as the kind of trajectory tells, its ends included."""
    from pydrake.trajectories import (
        BsplineTrajectory,
        CompositeTrajectory,
        PathParameterizedTrajectory,
        PiecewiseTrajectory,
    )

    ends = np.array([trajectory.start_time(), trajectory.end_time()])
    if isinstance(trajectory, BsplineTrajectory):
        return np.concatenate([ends, trajectory.basis().knots()])
    if isinstance(trajectory, CompositeTrajectory):
        inner = [_breaks(trajectory.segment(k)) for k in range(trajectory.get_number_of_segments())]
        return np.concatenate([ends, *inner])
    if isinstance(trajectory, PathParameterizedTrajectory):
        pace = trajectory.time_scaling()
        return np.concatenate([ends, _breaks(pace), _times_when(pace, _breaks(trajectory.path()))])
    if isinstance(trajectory, PiecewiseTrajectory):
        return np.concatenate([ends, trajectory.get_segment_times()])
    return ends


def _times_when(pace: Trajectory, shares: Array) -> Array:
    """``(K,)`` times at which a pace goes past any of these shares of its path, by bisection."""
    time_s = np.linspace(pace.start_time(), pace.end_time(), LOOKED_AT)
    gone = pace.vector_values(time_s)[0]
    ahead = gone[:, None] > shares
    before, which = np.nonzero(ahead[1:] != ahead[:-1])
    low, high, at_low = time_s[before], time_s[before + 1], ahead[before, which]
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        same = (pace.vector_values(middle)[0] > shares[which]) == at_low
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low


def _when(time_s: float) -> str:
    return f"at {time_s:.6f} s"
