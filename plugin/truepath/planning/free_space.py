"""Where the arm may be and which way it may go: free of collision with a margin, the beam of the tracker unbroken.

Everything is asked of Drake through ``clearance.Cell``. Shapes of neighbouring links are nearer to each other than any
margin by their design: for pairs of bodies that are so in most postures only touching counts.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from truepath.clearance import Cell
from truepath.lie import Array
from truepath.model import CalibratedModel

MARGIN_M = 0.02  # between the arm and what it must not touch, at poses
ON_THE_WAY = 0.5  # of it on ways, or there would be none away from a pose that just keeps it
COARSE_RAD, FINE_RAD = 0.08, 0.02  # steps of the fastest joint
NEIGHBOURS = 0.5  # share of free postures in which bodies must be nearer than the margin to count as neighbours
SAMPLED_POSTURES = 60
BEAM_START_M, BEAM_RADIUS_M, MOST_STEPS = 0.005, 0.002, 60


class FreeSpace:
    """The cell as seen by an arm that moves in it.

    Args:
        spec: built-in name, URDF or directives; of a built-in robot the cell that comes with it.
        model: the robot, nominal or calibrated; joints below are commanded ones.
        margin_m: clearance to keep at poses; on ways half of it.

    Raises:
        InputError: as ``clearance.Cell``.
    """

    def __init__(self, spec: str | Path, model: CalibratedModel, margin_m: float = MARGIN_M) -> None:
        # What effects do to the joints is far below the margin, and slow to work out one posture after the other.
        self.cell, self.margin_m = Cell(spec, replace(model, effects=(), residual=None)), margin_m
        self._ways: dict[bytes, bool] = {}
        lower, upper = np.maximum(model.robot.lower_rad, -np.pi), np.minimum(model.robot.upper_rad, np.pi)
        drawn = np.random.default_rng(0).uniform(lower, upper, (8 * SAMPLED_POSTURES, len(lower)))
        free = drawn[~self.cell.collides(drawn)][:SAMPLED_POSTURES]
        near = self.cell.clearances(free, margin_m)
        often = (near.by_pair_m <= margin_m).sum(axis=0) >= NEIGHBOURS * max(len(free), 1)
        self._neighbours = {pair for pair, so in zip(near.bodies, often, strict=True) if so}

    def are_free(self, q_rad: Array) -> Array:
        """``(N,)`` whether the arm at joints ``(N, n)`` keeps its margin."""
        free = ~self.cell.collides(q_rad)
        for k in np.flatnonzero(free):  # unrelated postures: Drake has to look at each
            free[k] = self._keeps(self.margin_m, q_rad[k : k + 1])
        return free

    def way_is_free(self, start: Array, end: Array) -> bool:
        """Whether all joints in step lead from ``(n,)`` to ``(n,)`` with margin; asked in fine steps, remembered."""
        key = np.concatenate([start, end] if tuple(start) < tuple(end) else [end, start]).tobytes()
        if key not in self._ways:
            self._ways[key] = self.seems_free(start, end) and self._keeps(
                ON_THE_WAY * self.margin_m, _steps(start, end, FINE_RAD)
            )
        return self._ways[key]

    def seems_free(self, start: Array, end: Array) -> bool:
        """A quick look at a way: nothing touches in coarse steps, its middle first."""
        steps = _steps(start, end, COARSE_RAD)
        order = np.argsort(_halving(len(steps)), kind="stable")
        return not any(self.cell.collides(steps[k : k + 1])[0] for k in order)

    def _keeps(self, margin_m: float, q_rad: Array) -> bool:
        near = self.cell.clearances(q_rad, margin_m)
        watched = [p for p, pair in enumerate(near.bodies) if pair not in self._neighbours]
        touched = near.by_pair_m.min(initial=np.inf) <= 0.0
        return not touched and bool(near.by_pair_m[:, watched].min(initial=np.inf) > margin_m)

    def beam_is_unbroken(self, q_rad: Array, p_WE: Array, p_WT: Array) -> bool:
        """Whether nothing of cell and arm stands between reflector ``(3,)`` and tracker ``(3,)``, the arm at ``(n,)``.

        Along the beam from the reflector on, no further at a time than the nearest shape is away (sphere tracing).
        Shapes that hold the reflector's centre are its own ball.
        """
        query = self.cell.query_at(q_rad)
        own = {found.id_G for found in query.ComputeSignedDistanceToPoint(p_WE) if found.distance <= 0.0}
        length = float(np.linalg.norm(p_WT - p_WE))
        along, travelled = (p_WT - p_WE) / length, BEAM_START_M
        for _ in range(MOST_STEPS):
            if travelled >= length:
                return True
            found = query.ComputeSignedDistanceToPoint(p_WE + travelled * along)
            nearest = min((other.distance for other in found if other.id_G not in own), default=np.inf)
            if nearest <= BEAM_RADIUS_M:
                return False
            travelled += nearest
        return False  # so many small steps: it grazes something


def _steps(start: Array, end: Array, step_rad: float) -> Array:
    count = max(int(np.ceil(np.abs(end - start).max() / step_rad)), 1)
    return np.linspace(start, end, count + 1)


def _halving(count: int) -> Array:
    """``(count,)`` rank of each step: the ends and the middle first, then the middles of the halves."""
    index = np.arange(count)
    lowest_bit = np.where(index > 0, index & -index, 1 << 30)
    return -lowest_bit
