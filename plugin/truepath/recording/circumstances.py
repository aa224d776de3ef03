"""What must be the same when a recording goes on: robot, model, payload and tracker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from truepath.errors import InputError

SAME_PAYLOAD_KG = 0.01


@dataclass(frozen=True)
class Circumstances:
    """Under which rows are recorded. None: not known, and then not compared.

    Attributes:
        model_sha256: of the nominal kinematics.
        payload_kg: on the flange beyond the model's.
        tracker: as it was named; of a file only that it is one, since a new day may have a new file.
        serial_number: of the robot.
    """

    model_sha256: str | None = None
    payload_kg: float | None = None
    tracker: str | None = None
    serial_number: str | None = None

    def as_json(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if value is not None}

    def require_same(self, written: Mapping[str, Any], side_file: Path) -> None:
        """Raises InputError for the first that differs from what was written down when the recording began."""
        for name, now in self.as_json().items():
            before = written.get(name)
            if before is None or before == now:
                continue
            both_numbers = isinstance(before, int | float) and isinstance(now, float)
            if both_numbers and abs(before - now) <= SAME_PAYLOAD_KG:
                continue
            raise InputError(
                "the recording was begun under other circumstances",
                file=side_file,
                column=name,
                expected=f"{str(before)[:80]}, or another output",
                found=str(now),
            )


def tracker_kind(spec: str) -> str:
    """What of the name of a tracker must stay the same."""
    return "file" if spec.startswith("file:") else spec
