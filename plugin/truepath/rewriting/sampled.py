"""A trajectory in memory as a program: its joints at some moments, which every guard of programs can look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath.lie import Array
from truepath.programs.motions import Motions, joint_path
from truepath.programs.program import NewTargets, Unresolved, Via


@dataclass(frozen=True, eq=False)
class SampledTrajectory:
    """K samples; see ``programs.program.Program``. A line of it is a sample, from 1.

    It is one of motions of the joints whose speed is not stated: the samples say nothing of it. What the trajectory
    itself says is judged in ``trajectory``.

    Attributes:
        file: name for messages.
        time_s: ``(K,)``.
        q_rad: ``(K, n)``.
    """

    file: str
    time_s: Array
    q_rad: Array
    comment: str | None = None
    text: str = ""
    states_tool: bool = False
    unresolved: tuple[Unresolved, ...] = ()
    unreached: tuple[int, ...] = ()

    @property
    def raw(self) -> bytes:
        """The samples as a table."""
        return self._table(self.q_rad)

    @property
    def motions(self) -> Motions:
        """From one sample to the next."""
        return joint_path(self.q_rad, np.eye(4)[None], np.arange(len(self.q_rad)) + 1)

    def statement(self, at: int) -> str:
        """A sample."""
        return ", ".join(f"{q:.6f}" for q in self.q_rad[at])

    def can_be_added_before(self, at: int) -> bool:
        """Samples lie where the correction needs them already."""
        return False

    def rewritten(self, new: NewTargets, vias: Sequence[Via], header: str) -> bytes:
        """The table with new joints."""
        q = self.q_rad.copy()
        q[new.index] = new.q_near_rad
        return self._table(q)

    def _table(self, q_rad: Array) -> bytes:
        names = ",".join(["t_s", *(f"q{i + 1}_rad" for i in range(q_rad.shape[1]))])
        rows = np.char.mod("%.12f", np.column_stack([self.time_s, q_rad]))
        return "\n".join([names, *map(",".join, rows.tolist()), ""]).encode()
