"""What a running program tells its robot to do, one thing at a time.

Frames: C the controller's base, 0 its tool flange, T tool. Poses are ``(x, y, z, rx, ry, rz)``: m, rotation vector in
rad. Numbers are finite, whatever the program says.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from truepath.lie import Array
from truepath.programs.motions import Kind

Six = tuple[float, ...]


class ScriptError(Exception):
    """The program cannot go on; a controller stops it with this message.

    Attributes:
        line: of the program, from 1; None where no line is to blame.
        reason: in plain words.
    """

    def __init__(self, reason: str, line: int | None = None) -> None:
        self.reason, self.line = reason, line
        super().__init__(reason if line is None else f"line {line}: {reason}")


class Kinematics(Protocol):
    """What the controller believes its arm to be."""

    def forward(self, q_rad: Array) -> Array:
        """``(4, 4)`` X_C0 at joints ``(6,)``."""

    def inverse(self, X_C0: Array, q_near_rad: Array) -> Array | None:
        """Joints ``(6,)`` of the posture nearest to ``(6,)``; None where the arm cannot be."""


@dataclass(frozen=True)
class Instruction:
    """One thing to do.

    Attributes:
        line: of the program, from 1.
    """

    line: int


@dataclass(frozen=True)
class Move(Instruction):
    """Go to a target.

    Attributes:
        kind: how: JOINT, LINEAR, PROCESS, ARC (a ``movec``, through ``via``) or SERVO.
        q_rad: ``(6,)`` joints at the target. Along a line, the ones nearest to where the line begins: whoever follows
            the line by small steps may end in others.
        pose: X_CT at the target.
        via: X_CT of the point that an ARC passes; None for all others.
        follows_orientation: an ARC at whose end the tool has turned along with the arc (mode 1); what ``pose`` says of
            orientation does not count then.
        tool: X_0T in force.
        speed, acceleration: tool in m/s and m/s^2; for JOINT the leading joint in rad/s and rad/s^2. The defaults of
            the script manual where none is stated.
        time_s: stated instead of speed; None: by speed and acceleration. For SERVO how long it holds the controller.
        blend_m: radius within which the next move may begin; 0: stop.
        stated_as_pose: by the program, so that ``q_rad`` is what the controller makes of it.
    """

    kind: Kind
    q_rad: Six
    pose: Six
    via: Six | None
    follows_orientation: bool
    tool: Six
    speed: float
    acceleration: float
    time_s: float | None
    blend_m: float
    stated_as_pose: bool = False


@dataclass(frozen=True)
class SpeedJoints(Instruction):
    """``speedj`` and ``stopj`` (all zero): joint speeds ``(6,)`` rad/s, reached with an acceleration, held for a time.

    Attributes:
        time_s: None: until the next instruction.
    """

    speed_rad_s: Six
    acceleration: float
    time_s: float | None


@dataclass(frozen=True)
class Wait(Instruction):
    """``sleep``, ``sync`` (one cycle): nothing happens for a time."""

    time_s: float


@dataclass(frozen=True)
class SetTcp(Instruction):
    """X_0T from now on."""

    tool: Six


@dataclass(frozen=True)
class SetPayload(Instruction):
    """Mass on the flange and its centre ``(3,)`` in 0, m; the centre is None where the program leaves it as it was."""

    mass_kg: float
    centre_m: tuple[float, float, float] | None


class Output(Enum):
    """Kinds of outputs."""

    DIGITAL = "standard_digital"
    CONFIGURABLE = "configurable_digital"
    TOOL = "tool_digital"
    ANALOGUE = "standard_analog"


@dataclass(frozen=True)
class SetOutput(Instruction):
    """An output takes a value: 0 or 1, a share for ANALOGUE."""

    kind: Output
    number: int
    value: float


@dataclass(frozen=True)
class Message(Instruction):
    """``textmsg`` (log) or ``popup``."""

    text: str
    popup: bool
