"""One sample of what a Universal Robot says about itself over RTDE."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from truepath.lie import Array

RUNNING_MODE = 7  # robot_mode RUNNING of the RTDE guide: power on, brakes released
PLAYING = 2  # runtime_state of the RTDE guide
ENDED = (0, 1)  # runtime_state stopping, stopped; a program that is pausing, paused or resuming is not over
SAFETY_MODES = {
    1: "normal",
    2: "reduced",
    3: "protective_stop",
    4: "recovery",
    5: "safeguard_stop",
    6: "emergency_stop",
    7: "emergency_stop",
    8: "violation",
    9: "fault",
}
# safety_status_bits, the gravest first; "stopped due to safety" stands for a stop that has no bit of its own.
SAFETY_BITS = {
    9: "fault",
    8: "violation",
    7: "emergency_stop",
    6: "emergency_stop",
    5: "emergency_stop",
    4: "safeguard_stop",
    3: "recovery",
    2: "protective_stop",
    10: "safety_stop",
}
ABLE_TO_MOVE = ("normal", "reduced")


@dataclass(frozen=True, eq=False)
class RobotState:
    """A robot at one moment.

    Attributes:
        time_s: clock of the controller.
        arrived_s: ``time.monotonic()`` of this machine when it was read.
        q_rad, q_target_rad, speed_rad_s: ``(6,)`` actual joints, where the controller wants them, actual speeds.
        temperatures_c: ``(6,)`` of the joints.
        tcp_pose: ``(6,)`` x, y, z (m) and rotation vector (rad) of the tool as the controller believes it to be.
        tcp_offset: ``(6,)`` the same of the tool on the flange; None while nobody has asked (see ``RobotLink``).
        robot_mode: as in the RTDE guide, 7 when the robot is able to move.
        safety: normal, reduced, protective_stop, recovery, safeguard_stop, emergency_stop, violation, fault,
            safety_stop or unknown.
        program_running: whether there is a program on the controller that has begun and not ended; it may be paused.
        program_plays: it is not paused.
        speed_fraction: by how much the speed slider slows moves down, 1 for not at all.
        payload_kg, payload_cog_m: None from a controller older than PolyScope 5.11, which does not tell.
    """

    time_s: float
    arrived_s: float
    q_rad: Array
    q_target_rad: Array
    speed_rad_s: Array
    temperatures_c: Array
    tcp_pose: Array
    robot_mode: int
    safety: str
    program_running: bool
    speed_fraction: float = 1.0
    payload_kg: float | None = None
    payload_cog_m: Array | None = None
    tcp_offset: Array | None = None
    program_plays: bool = False

    @property
    def able_to_move(self) -> bool:
        return self.safety in ABLE_TO_MOVE and self.robot_mode == RUNNING_MODE


def from_sample(sample: Mapping[str, Any], tcp_offset: Array | None = None) -> RobotState:
    """A state from what the reading child sends; see ``reading_child``."""
    cog = sample["payload_cog_m"]
    return RobotState(
        time_s=float(sample["time_s"]),
        arrived_s=float(sample["arrived_s"]),
        q_rad=np.array(sample["q"]),
        q_target_rad=np.array(sample["q_target"]),
        speed_rad_s=np.array(sample["speed"]),
        temperatures_c=np.array(sample["temperatures"]),
        tcp_pose=np.array(sample["tcp_pose"]),
        robot_mode=int(sample["robot_mode"]),
        safety=safety_of(int(sample["safety_mode"]), int(sample["safety_bits"])),
        program_running=int(sample["runtime_state"]) not in ENDED,
        speed_fraction=float(sample["speed_fraction"]),
        payload_kg=sample["payload_kg"],
        payload_cog_m=None if cog is None else np.array(cog),
        tcp_offset=tcp_offset,
        program_plays=int(sample["runtime_state"]) == PLAYING,
    )


def safety_of(mode: int, bits: int) -> str:
    """The name of the worse of the two things that a controller says about its safety."""
    for bit, name in SAFETY_BITS.items():
        if bits >> bit & 1:
            return name
    return SAFETY_MODES.get(mode, "unknown")
