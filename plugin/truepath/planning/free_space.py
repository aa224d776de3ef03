"""Where the arm may be and which way it may go: free of collision with a margin, the beam of the tracker unbroken.

Everything is asked of Drake, through ``roomy.RoomyCell``. Shapes of neighbouring links are nearer to each other than
any margin by their design: for pairs of bodies that are so in most postures only touching counts.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.planning.roomy import RoomyCell

MARGIN_M = 0.02  # between the arm and what it must not touch, at poses
ON_THE_WAY = 0.5  # of it on ways, or there would be none away from a pose that just keeps it
FINE_RAD, FINE_IN_COARSE = 0.02, 8  # steps of the fastest joint on a way, and how many of them a quick look takes
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
        self.cell = RoomyCell(spec, replace(model, effects=(), residual=None), margin_m)
        self._at_poses, self._on_ways = self.cell.room(margin_m), self.cell.room(ON_THE_WAY * margin_m)
        self._seen: dict[tuple[bytes, bool], bool] = {}

    def are_free(self, q_rad: Array) -> Array:
        """``(N,)`` whether the arm at joints ``(N, n)`` keeps its margin."""
        return np.array([self._at_poses.is_kept(q) for q in q_rad], bool)  # Drake answers one posture at a time

    def way_is_free(self, start: Array, end: Array) -> bool:
        """Whether all joints in step lead from ``(n,)`` to ``(n,)`` with margin, in fine steps."""
        return self.seems_free(start, end) and self._remembered(start, end, thoroughly=True)

    def seems_free(self, start: Array, end: Array) -> bool:
        """A quick look at a way: the same in coarse steps."""
        return self._remembered(start, end, thoroughly=False)

    def _remembered(self, start: Array, end: Array, *, thoroughly: bool) -> bool:
        start, end = (start, end) if tuple(start) < tuple(end) else (end, start)
        key = (start.tobytes() + end.tobytes(), thoroughly)
        if key not in self._seen:
            coarse = max(int(np.ceil(np.abs(end - start).max() / (FINE_IN_COARSE * FINE_RAD))), 1)
            shares = _shares(coarse, thoroughly)
            self._seen[key] = all(self._on_ways.is_kept(start + share * (end - start)) for share in shares)
        return self._seen[key]

    def beam_is_unbroken(self, q_rad: Array, p_WE: Array, p_WT: Array) -> bool:
        """Whether nothing of cell and arm stands between reflector ``(3,)`` and tracker ``(3,)``, the arm at ``(n,)``.

        Along the beam from the reflector on, no further at a time than the nearest shape is away (sphere tracing).
        Shapes that hold the reflector's centre are its own ball.
        """
        query = self.cell.query_at(q_rad)
        own = {found.id_G for found in query.ComputeSignedDistanceToPoint(p_WE, 0.0) if found.distance <= 0.0}
        length = float(np.linalg.norm(p_WT - p_WE))
        along, travelled, nearest = (p_WT - p_WE) / length, BEAM_START_M, np.inf
        for _ in range(MOST_STEPS):
            if travelled >= length:
                return True
            for found in query.ComputeSignedDistanceToPoint(p_WE + travelled * along, nearest):
                if found.distance < nearest and found.id_G not in own:
                    nearest = found.distance
            if nearest <= BEAM_RADIUS_M:
                return False
            travelled += nearest
            nearest *= 2.0  # at the next point at most: as far as from this one, and the step
        return False  # so many small steps: it grazes something


@lru_cache(maxsize=1024)
def _shares(coarse: int, fine: bool) -> tuple[float, ...]:
    """Where on a way to look, from 0 to 1: at its coarse steps, or at the fine ones between them.

    The ends and the middle come first, then the middles of the halves: what blocks a way is found soon.
    """
    count = FINE_IN_COARSE * coarse
    steps = np.arange(count + 1)
    steps = steps[(steps % FINE_IN_COARSE != 0) == fine]
    index = np.arange(len(steps))
    lowest_bit = np.where(index > 0, index & -index, 1 << 30)
    return tuple((steps[np.argsort(-lowest_bit, kind="stable")] / count).tolist())
