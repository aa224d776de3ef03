"""How a program is to be corrected."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from truepath.controller import NOMINAL
from truepath.correct import MAX_CORRECTION_MM
from truepath.guards import MAX_AGE_DAYS

if TYPE_CHECKING:
    from truepath.posed_cell import Surroundings

PATH_TOLERANCE_MM = 0.05
NOWHERE = "none"


@dataclass(frozen=True)
class RewriteOptions:
    """What a user can choose.

    Attributes:
        express: corrected targets as ``joints`` or as ``poses``; None: as the line held them.
        controller_kinematics: by which the controller turns poses into joints: see ``controller.controller_of``.
        path_tolerance_mm: how far the tool may leave the straight line or arc between two targets before a target is
            added on the way; None: nothing is added.
        max_correction_mm: no target may move further.
        cell: model of the cell in which collisions are looked for; None or ``none``: nowhere. In a host None leaves the
            choice to it (``CalibrationPlugin.correct``: its own plant), and ``none`` means nowhere there too.
        surroundings: the same in memory, as a host has it; it takes the place of ``cell``.
        start_rad: joints from which the program starts, where its first target is a pose.
        tool: TCP in force before the program sets one: position in m, rotation vector in rad, on the tool flange.
        max_age_days: a calibration older than this is worth a warning.
    """

    express: Literal["joints", "poses"] | None = None
    controller_kinematics: str = NOMINAL
    path_tolerance_mm: float | None = PATH_TOLERANCE_MM
    max_correction_mm: float = MAX_CORRECTION_MM
    cell: str | None = None
    surroundings: Surroundings | None = None
    start_rad: tuple[float, ...] | None = None
    tool: tuple[float, ...] | None = None
    max_age_days: int = MAX_AGE_DAYS

    @property
    def looks_in(self) -> str | Surroundings | None:
        """Where collisions are looked for; None: nowhere."""
        if self.surroundings is not None:
            return self.surroundings
        return None if self.cell == NOWHERE else self.cell
