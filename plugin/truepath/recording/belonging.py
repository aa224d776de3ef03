"""Whether a reading belongs to the pose at which it was taken, as far as a robot as drawn can tell."""

from __future__ import annotations

import numpy as np

from truepath.errors import CalibrationError
from truepath.frames import register
from truepath.lie import Array
from truepath.model import nominal_model
from truepath.recording.visit import Recorded
from truepath.robot import NominalRobot
from truepath.robot_link import RobotFault

FEWEST_VISITS = 6  # 18 numbers for the 9 of base and reflector
FARTHEST_OFF_M = 0.02  # a real robot is off by some millimetres
MOVED_M = 1e-3
SAME_M = 1e-9
FEW_VISITS = 12  # of so many each is left out in turn to find which is wrong
MOST_NAMED = 12


class Belonging:
    """Holds each reading against the nominal robot, placed so that it fits all readings of the recording so far.

    Args:
        robot: as drawn.
        recorded: visits that are on the disk already.

    Raises:
        RobotFault: those do not fit together.
    """

    def __init__(self, robot: NominalRobot, recorded: Recorded | None = None) -> None:
        self._model = nominal_model(robot)
        if recorded is None or not len(recorded.row):
            self._row, self._X_BF, self._p_ME = np.empty(0, int), np.empty((0, 4, 4)), np.empty((0, 3))
            return
        self._row, self._p_ME = recorded.row, recorded.p_ME
        self._X_BF = self._model.predict(recorded.q_rad)
        if len(self._row) >= FEWEST_VISITS:
            off_m = _off_m(self._X_BF, self._p_ME)
            if (off_m > FARTHEST_OFF_M).any():
                raise _doubtful(self._row, off_m, _alone_to_blame(self._X_BF, self._p_ME, off_m))

    def why_not(self, row: int, q_rad: Array, p_ME: Array) -> str:
        """In words why a reading cannot be of this pose; empty if it can, and then it counts from now on.

        Args:
            row: of the pose list, from 0.
            q_rad: ``(n,)`` commanded joints.
            p_ME: ``(3,)`` the reading, m.

        Raises:
            RobotFault: the tracker says the same at two places; readings that have counted so far do not fit together.
        """
        X_BF, p_ME = self._model.predict(q_rad[None]), p_ME[None]
        elsewhere = np.linalg.norm(self._X_BF[:, :3, 3] - X_BF[:, :3, 3], axis=1) > MOVED_M
        if (elsewhere & (np.abs(self._p_ME - p_ME).max(axis=1) < SAME_M)).any():
            raise RobotFault("the tracker says exactly the same at two different poses: its readings are frozen")
        all_row, all_X_BF = np.append(self._row, row), np.concatenate([self._X_BF, X_BF])
        all_p_ME = np.concatenate([self._p_ME, p_ME])
        if len(all_row) >= FEWEST_VISITS:
            off_m = _off_m(all_X_BF, all_p_ME)
            if (off_m > FARTHEST_OFF_M).any():
                return _why_not(all_row, off_m, _alone_to_blame(all_X_BF, all_p_ME, off_m))
        self._row, self._X_BF, self._p_ME = all_row, all_X_BF, all_p_ME
        return ""


def _why_not(row: Array, off_m: Array, to_blame: list[int]) -> str:
    """What to say of the last of some readings. Raises RobotFault if it is not that one, or not it alone."""
    new = len(row) - 1
    if new not in to_blame:
        raise _doubtful(row, off_m, to_blame)
    how_far = (
        f"{1e3 * off_m[new]:.0f} mm from where the other readings have it" if np.isfinite(off_m[new]) else "far off"
    )
    why = f"the reading does not belong to this pose: {how_far}"
    others = [k for k in to_blame if k != new]
    if others:
        why += f", unless it is that of visit {_named(row[others], ' or ')} which is wrong"
    return f"{why} (was the tracker moved, or has it caught another reflector?)"


def _alone_to_blame(X_BF: Array, p_ME: Array, off_m: Array) -> list[int]:
    """Readings without each of which all others fit together. Of many the robust fit knows which is off."""
    few = len(p_ME) <= FEW_VISITS
    candidates: list[int] = np.flatnonzero((off_m > FARTHEST_OFF_M) | few).tolist()
    if len(candidates) > FEW_VISITS:
        return []
    return [k for k in candidates if _fit(np.delete(X_BF, k, axis=0), np.delete(p_ME, k, axis=0))]


def _fit(X_BF: Array, p_ME: Array) -> bool:
    return bool((_off_m(X_BF, p_ME) <= FARTHEST_OFF_M).all())


def _off_m(X_BF: Array, p_ME: Array) -> Array:
    """``(K,)`` distances of readings ``(K, 3)`` from the nominal robot, placed so that it fits most of them."""
    try:
        X_MB, X_FE = register(X_BF, p_ME)
    except CalibrationError:  # half of them are off by more than 0.1 m: nobody can tell which
        return np.full(len(p_ME), np.inf)
    return np.linalg.norm((X_MB @ X_BF @ X_FE)[:, :3, 3] - p_ME, axis=1)


def _doubtful(row: Array, off_m: Array, to_blame: list[int]) -> RobotFault:
    """Says which visits are in doubt: all of them, if too few are left to say so."""
    off = to_blame or np.flatnonzero(off_m > FARTHEST_OFF_M)
    if len(row) - len(off) >= max(FEWEST_VISITS - 1, len(row) / 2):
        return RobotFault(
            f"a reading does not belong to its pose: that of visit {_named(row[off], ' or ')} lies more than "
            f"{1e3 * FARTHEST_OFF_M:.0f} mm from where the others have it; take the lines of wrong visits out of the "
            "output, and --resume measures them again"
        )
    return RobotFault(
        "the readings do not belong to their poses, and nobody can tell which are wrong: in doubt are visits "
        f"{_named(row, ' and ')} (other units, another robot, a tracker that was moved or is late); record into "
        "another output, or take out the lines of which you know that they are wrong"
    )


def _named(row: Array, conjunction: str) -> str:
    visits = [str(k + 1) for k in row]
    if len(visits) > MOST_NAMED:
        visits = [*visits[:MOST_NAMED], f"{len(visits) - MOST_NAMED} more"]
    return ", ".join(visits[:-1]) + conjunction + visits[-1] if len(visits) > 1 else visits[0]
