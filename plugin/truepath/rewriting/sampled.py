"""A trajectory in memory as a program: its joints at some moments, which every guard of programs can look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath.lie import Array
from truepath.programs.motions import Kind, Motions
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
        count = len(self.q_rad)
        nothing = np.full(count, np.nan)
        before = np.arange(count) - 1
        return Motions(
            kind=np.full(count, int(Kind.JOINT)),
            q_rad=self.q_rad,
            X_CT=np.full((count, 4, 4), np.nan),
            q_near_rad=np.full_like(self.q_rad, np.nan),
            tools=np.eye(4)[None],
            tool=np.zeros(count, int),
            line=np.arange(count) + 1,
            previous=before,
            origin=before,
            starts=before < 0,
            speed=nothing,
            acceleration=nothing,
            time_s=nothing,
            blend_m=nothing,
        )

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
