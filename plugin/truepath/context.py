"""What is known about poses besides the commanded joints: when, how warm, how loaded, from which side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from truepath.lie import Array

if TYPE_CHECKING:
    from truepath.measurements import Measurements


RECORDED = ("time_s", "row", "temperature_c", "approach", "came_by", "p_ME", "R_MF")


@dataclass(frozen=True, eq=False)
class Context:
    """N poses with their circumstances; None for what nobody recorded.

    Attributes:
        q_rad: ``(N, n)`` commanded joints.
        payload_kg: ``(N,)`` or one number, mass on the flange beyond what the robot's model carries; None where nobody
            recorded it: then it is what the robot carried when it was calibrated.
        time_s: ``(N,)`` on the clock of the measuring campaign.
        row: ``(N,)`` place in the order of measurement, for campaigns without a clock.
        temperature_c: ``(N,)``.
        approach: ``(N, n)`` in {-1, 0, 1}, direction from which each joint arrived.
        came_by: ``(N, n)`` in {-1, 0, 1}, where each joint lies against the pose measured just before.
        p_ME: ``(N, 3)`` where the probe was seen, m.
        R_MF: ``(N, 3, 3)`` how the flange stood, for the tracker.
    """

    q_rad: Array
    payload_kg: Array | float | None = None
    time_s: Array | None = None
    row: Array | None = None
    temperature_c: Array | None = None
    approach: Array | None = None
    came_by: Array | None = None
    p_ME: Array | None = None
    R_MF: Array | None = None

    @classmethod
    def of(cls, measurements: Measurements, *, same_campaign: bool = True) -> Context:
        """Circumstances of measured poses.

        Args:
            measurements: the poses.
            same_campaign: whether these rows belong to the file that a model was learnt from. Only then does
                their place in the order of measurement mean anything to the model.
        """
        return cls(
            q_rad=measurements.q_rad,
            payload_kg=measurements.payload_kg,
            time_s=measurements.time_s,
            row=measurements.line.astype(float) if same_campaign else None,
            temperature_c=measurements.temperature_c,
            approach=measurements.approach,
            came_by=np.sign(np.diff(measurements.q_rad, axis=0, prepend=measurements.q_rad[:1])),
            p_ME=measurements.p_ME,
        )

    def __len__(self) -> int:
        return len(self.q_rad)

    @property
    def known_payload_kg(self) -> Array | float:
        """``(N,)`` or one number; 0 where none was recorded."""
        return 0.0 if self.payload_kg is None else self.payload_kg

    @property
    def clock(self) -> str:
        """Name of what tells the time of a campaign: ``time_s``, or ``row`` where no time was recorded."""
        return "row" if self.time_s is None else "time_s"

    def subset(self, rows: Array) -> Context:
        """The poses picked by an index or boolean array."""

        def pick(values: Array | float | None) -> Any:
            return values if values is None or np.ndim(values) == 0 else np.asarray(values)[rows]

        picked = {name: pick(getattr(self, name)) for name in ("payload_kg", *RECORDED)}
        return Context(self.q_rad[rows], **picked)


def as_context(poses: Array | Context) -> Context:
    """Joints ``(N, n)`` or one row of them, of which nothing else is known, as a context; a context as it is."""
    return poses if isinstance(poses, Context) else Context(np.atleast_2d(poses))
