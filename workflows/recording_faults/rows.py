"""Rows of a recording held against the list of poses and against the robot as Drake knows it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from truepath.lie import Array
from truepath.measurements import from_table
from truepath.planning.pose_list import PoseList
from truepath.tables import read_table
from truepath.virtual.hidden_causes import draw_causes, true_poses
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.visits import Visits

NOISE_MM = 0.02  # of the virtual tracker, per coordinate of one reading
SIGMAS = 6.0
LEAST_READINGS = 3


class Truth:
    """The robot behind a virtual controller.

    Args:
        seed: of its hidden errors.
        hidden: names of its hidden causes.
    """

    def __init__(self, seed: int, hidden: Sequence[str]) -> None:
        self._real = RealRobot("ur5_cell", seed)
        self._causes = list(draw_causes(self._real, hidden).values())

    def positions(self, q_rad: Array, approach: Array) -> Array:
        """``(N, 3)`` p_ME at commanded joints ``(N, n)`` that arrived from ``(N, n)`` in {-1, 0, 1}, m."""
        visits = Visits(q_rad, np.zeros(len(q_rad)), approach, self._real.gravity_torques(q_rad))
        return true_poses(self._real, visits, self._causes)[:, :3, 3]


def complete_rows(path: Path) -> list[bytes]:
    """Lines of a file that have their end, the header first; none of a file that is not there."""
    content = path.read_bytes() if path.exists() else b""
    return content[: content.rfind(b"\n") + 1].splitlines(keepends=True)


def what_is_wrong(path: Path, kept: Sequence[list[bytes]], poses: PoseList, truth: Truth) -> list[str]:
    """In words; empty if every pose was kept once, none is lost and none invented.

    Args:
        path: the data set at the end.
        kept: its complete lines at each interruption.
        poses: the list.
        truth: where the reflector really was.
    """
    if not path.exists():
        return ["nothing was recorded"]
    wrong = []
    if any(complete_rows(path)[: len(lines)] != lines for lines in kept):
        wrong.append("rows that were on the disk are not there any more")
    table = read_table(path)
    data = from_table(table, poses.q_rad.shape[1])
    visits = [int(cell) - 1 for cell in table.text("visit")]
    wanted = np.flatnonzero(poses.measure).tolist()
    wrong += [f"row {row + 1} is recorded {visits.count(row)} times" for row in wanted if visits.count(row) != 1]
    wrong += [f"row {row + 1} is recorded, which is not to be measured" for row in visits if row not in wanted]
    off = np.abs(data.q_rad - poses.q_rad[visits]).max(axis=1)
    wrong += [f"row {visits[k] + 1} has other joints" for k in np.flatnonzero(off > 1e-8)]
    assert data.approach is not None
    error_mm = 1e3 * np.abs(data.p_ME - truth.positions(data.q_rad, data.approach)).max(axis=1)
    count = np.maximum(table.numbers(["readings"])[:, 0], 1.0)
    if (count < LEAST_READINGS).any():
        wrong.append("a row of hardly any readings")
    for k in np.flatnonzero(error_mm > SIGMAS * NOISE_MM / np.sqrt(count)):
        wrong.append(f"row {visits[k] + 1} was measured {error_mm[k]:.4f} mm from where the robot was")
    return wrong
