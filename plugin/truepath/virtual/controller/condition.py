"""What state the robot is in besides where it is: power, safety, program. Numbers as in the RTDE guide."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum


class RobotMode(IntEnum):
    """``robot_mode``."""

    POWER_OFF = 3
    IDLE = 5
    RUNNING = 7


class Safety(Enum):
    """``safety_mode`` and the bits of ``safety_status_bits``."""

    NORMAL = (1, 1 << 0)
    PROTECTIVE_STOP = (3, 1 << 2 | 1 << 10)
    EMERGENCY_STOP = (7, 1 << 6 | 1 << 7 | 1 << 10)

    @property
    def mode(self) -> int:
        return self.value[0]

    @property
    def bits(self) -> int:
        return self.value[1]

    @property
    def dashboard_name(self) -> str:
        """As ``safetystatus`` answers."""
        return "ROBOT_EMERGENCY_STOP" if self is Safety.EMERGENCY_STOP else self.name


class Runtime(IntEnum):
    """``runtime_state``."""

    STOPPED = 1
    PLAYING = 2
    PAUSED = 4


@dataclass
class Condition:
    """The state that the protocols report.

    Attributes:
        stopped_at_s: robot time of the last protective stop.
        popup: text that a person would see; None where none is shown.
    """

    mode: RobotMode = RobotMode.RUNNING
    safety: Safety = Safety.NORMAL
    runtime: Runtime = Runtime.STOPPED
    remote_control: bool = True
    stopped_at_s: float = 0.0
    popup: str | None = None

    @property
    def may_move(self) -> bool:
        """Powered, brakes released, nothing stopped."""
        return self.mode is RobotMode.RUNNING and self.safety is Safety.NORMAL

    @property
    def robot_status_bits(self) -> int:
        """Power on, program running, teach button, power button."""
        powered = self.mode is not RobotMode.POWER_OFF
        return int(powered) | int(self.runtime is Runtime.PLAYING) << 1 | int(powered) << 3
