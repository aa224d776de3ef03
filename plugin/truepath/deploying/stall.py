"""A robot that stands while its program runs: for how long it may, and what happens then."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from truepath.deploying.rehearsal import Rehearsal

LEAST_STALL_S, TIMES_THE_WAIT = 20.0, 2.0


@dataclass(frozen=True)
class Stall:
    """Such a robot.

    Attributes:
        after_s: so long, and something is said of it.
        tell: gets what is said; without it the robot is stopped.
    """

    after_s: float
    tell: Callable[[str], None] | None = None


def may_stand(rehearsal: Rehearsal, stated_s: float | None) -> tuple[float, bool]:
    """For how long a robot may stand while its program runs, and whether it may go on standing, and is told of.

    Args:
        rehearsal: of the program. Where nobody knows how it goes on, nobody knows what it waits for.
        stated_s: by a user; None if nobody has.
    """
    if stated_s is not None:
        return stated_s, False
    return max(LEAST_STALL_S, TIMES_THE_WAIT * rehearsal.longest_wait_s), rehearsal.open_end is not None
