"""What every format offers: targets, what cannot be resolved, and the same text with other targets in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from truepath.lie import Array
from truepath.programs.motions import Motions


@dataclass(frozen=True)
class Unresolved:
    """A move whose target cannot be told without running the program."""

    line: int
    text: str
    why: str


@dataclass(frozen=True, eq=False)
class NewTargets:
    """Targets to be written.

    Attributes:
        index: ``(K,)`` which targets of the program.
        values: ``(K, 6)`` joints in rad, or position in m and rotation vector in rad, X_CT.
        is_pose: ``(K,)``.
        q_near_rad: ``(K, n)`` joints that a pose stands for.
    """

    index: Array
    values: Array
    is_pose: Array
    q_near_rad: Array


@dataclass(frozen=True)
class Via:
    """A target to be added on the way to another one.

    Attributes:
        before: index of the target of the program on whose way it lies (the first one of its move).
        values: numbers of each target of the move, as ``NewTargets.values``.
        is_pose: whether these are poses.
        blend_m: radius around it.
        share: of the motion that ends here; a stated time is split by it.
    """

    before: int
    values: tuple[tuple[float, ...], ...]
    is_pose: bool
    blend_m: float
    share: float


class Program(Protocol):
    """A program that was read."""

    @property
    def file(self) -> str:
        """Name for messages."""

    @property
    def raw(self) -> bytes:
        """Its content."""

    @property
    def text(self) -> str:
        """The same as text."""

    @property
    def comment(self) -> str | None:
        """Sign at the start of a comment; None if the format has none."""

    @property
    def motions(self) -> Motions:
        """Its targets, in the order in which they are written."""

    @property
    def unresolved(self) -> tuple[Unresolved, ...]:
        """Moves that stay as they are."""

    @property
    def unreached(self) -> tuple[int, ...]:
        """Lines of moves that are never made, and stay as they are."""

    @property
    def states_tool(self) -> bool:
        """Whether it says which tool it works with."""

    def statement(self, at: int) -> str:
        """What is written for a target."""

    def can_be_added_before(self, at: int) -> bool:
        """Whether a target can be added before that one."""

    def rewritten(self, new: NewTargets, vias: Sequence[Via], header: str) -> bytes:
        """Its content with new targets, targets added, and a comment line at its start; all else stays."""
