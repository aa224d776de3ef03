"""How a virtual controller is set up; travels as JSON from whoever starts one."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields

from truepath.errors import InputError
from truepath.virtual.controller.addresses import TRACKER_PORT


@dataclass(frozen=True)
class ControllerOptions:
    """See ``process.ControllerProcess``."""

    address: str = "127.0.0.1"
    robot: str = "ur5_cell"
    seed: int = 0
    hide: Sequence[str] = ()
    noise_mm: float = 0.02
    speed_up: float = 1.0
    payload_kg: float | None = None
    payload_cog_m: Sequence[float] | None = None
    tcp_offset: Sequence[float] | None = None
    remote_control: bool = True
    q_start_rad: Sequence[float] | None = None
    tracker_port: int = TRACKER_PORT
    tracker_rate_hz: float = 50.0
    tracker_at_m: Sequence[float] | None = None
    acceptance_deg: float = 180.0

    def to_json(self) -> str:
        """One line."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> ControllerOptions:
        """Raises:
        InputError: not what ``to_json`` writes.
        """
        try:
            content = json.loads(text)
        except ValueError as error:
            raise InputError("the options of a controller are one JSON object", found=text[:80]) from error
        names = {field.name for field in fields(cls)}
        if not isinstance(content, dict) or not set(content) <= names:
            raise InputError(
                "an option that a controller does not have", expected="some of " + ", ".join(sorted(names))
            )
        return cls(**content)
