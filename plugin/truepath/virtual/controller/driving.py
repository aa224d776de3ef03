"""Moves of a program, one path after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby

from truepath.virtual.controller.machine import Machine
from truepath.virtual.controller.planning import Leg, path


def drive(
    machine: Machine,
    legs: Sequence[Leg],
    done: Callable[[], None],
    leg_begins: Callable[[int], None] | None = None,
) -> None:
    """Drives legs from where the arm stands; corners between a joint move and a line are not rounded.

    Args:
        machine: whose arm moves, with the tool in force now.
        legs: in order.
        done: called at the end; not if something else takes over.
        leg_begins: called with the number of each leg, from 0.

    Raises:
        InputError: a leg that nobody can drive.
    """
    groups = [list(group) for _, group in groupby(legs, key=lambda leg: leg.joint)]

    def go_on(number: int, first: int) -> None:
        if number == len(groups):
            done()
            return
        group = groups[number]
        motion = path(machine.kinematics, machine.arm.sample()[0], machine.X_0T, group)
        marks = []
        if leg_begins is not None:
            marks = [(at, _call(leg_begins, first + k)) for k, at in enumerate(motion.schedule.starts_s)]
        machine.arm.begin(motion, lambda: go_on(number + 1, first + len(group)), marks)

    go_on(0, 0)


def _call(function: Callable[[int], None], number: int) -> Callable[[], None]:
    return lambda: function(number)
