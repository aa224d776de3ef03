"""Runs an ordinary URScript program: what it tells its robot, one instruction after the other."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from truepath.virtual.controller.script_expressions import Leave, Steps
from truepath.virtual.controller.script_instructions import (
    Instruction,
    Kinematics,
    Move,
    ScriptError,
    SpeedJoints,
    Wait,
)
from truepath.virtual.controller.script_robot import Ask, RobotCalls
from truepath.virtual.controller.script_syntax import JOIN, KILL, START, Syntax, read_syntax
from truepath.virtual.controller.script_values import number

MOST_STEPS, MOST_THREADS = 200_000, 20
CYCLE_S = 0.008


def run_script(
    text: str,
    q_start_rad: Sequence[float],
    kinematics: Kinematics,
    ask: Ask,
    *,
    tool: Sequence[float] = (0.0,) * 6,
    cycle_s: float = CYCLE_S,
) -> Iterator[Instruction]:
    """Follows a program lazily: it goes on when the next instruction is asked for.

    Whoever asks for the next instruction while the robot still moves (to blend) must know that sensors are asked then.
    Closing the iterator ends the program. Its threads take their turns while the main program moves or waits.

    Args:
        text: of the program.
        q_start_rad: ``(6,)`` joints at its start.
        kinematics: of the controller.
        ask: for everything that the program does not know by itself (``get_actual_joint_positions``,
            ``get_standard_digital_in``, ``get_actual_tcp_pose``, ...). The runner answers itself:
            get_target_joint_positions, get_target_tcp_pose, get_tcp_offset, get_forward_kin, get_inverse_kin,
            mathematics.
        tool: X_0T at the start.
        cycle_s: duration of ``sync``.

    Raises:
        ScriptError: at the first ``next``, if this is no program; later, if it does what no program may. Never
            anything else, whatever the text is; each ``next`` returns after a bounded number of steps.
    """
    running = None
    try:
        running = Running(read_syntax(text), q_start_rad, kinematics, ask, tool, cycle_s)
        yield from running.with_threads()
    except ScriptError as error:
        if error.line is None and running is not None:
            raise ScriptError(error.reason, running.line) from None
        raise
    except (RecursionError, MemoryError):
        raise ScriptError("calls and brackets are too deep", running.line if running else None) from None


@dataclass(eq=False)
class Thread:
    """One of the program's threads.

    Attributes:
        steps: what is left of it.
        asleep_s: how long it waits.
    """

    steps: Steps
    asleep_s: float = 0.0


class Running(RobotCalls):
    """One run with its threads, which take turns: none is interrupted before it does something that takes time."""

    most_steps = MOST_STEPS

    def __init__(
        self,
        syntax: Syntax,
        q_start_rad: Iterable[float],
        kinematics: Kinematics,
        ask: Ask,
        tool: Iterable[float],
        cycle_s: float,
    ) -> None:
        super().__init__(syntax, q_start_rad, kinematics, ask, tool, cycle_s)
        self.threads: dict[int, Thread] = {}
        self.numbers = itertools.count(1)

    def turns(self, endless: bool) -> Iterable[int]:
        return itertools.count()

    def with_threads(self) -> Iterator[Instruction]:
        """The instructions of all of them."""
        try:
            for each in self.program():
                if isinstance(each, Wait):
                    yield from self.wait(each)
                    continue
                yield each
                if takes_time(each):
                    yield from self.take_turns(float("inf"))
        except Leave:  # a halt in a thread
            return

    def wait(self, whole: Wait) -> Iterator[Instruction]:
        """In pieces, so that threads which wait for less have their turns."""
        left = whole.time_s
        while left > 0:
            soonest = min((thread.asleep_s for thread in self.threads.values()), default=left)
            piece = min(left, max(self.cycle_s, soonest))
            yield Wait(whole.line, piece)
            left -= piece
            yield from self.take_turns(piece)

    def take_turns(self, passed_s: float) -> Iterator[Instruction]:
        self.steps = 0
        for handle, thread in list(self.threads.items()):
            thread.asleep_s -= passed_s
            while thread.asleep_s <= 0 and handle in self.threads:
                try:
                    each = next(thread.steps)
                except StopIteration:
                    self.threads.pop(handle, None)
                    break
                if isinstance(each, Wait):
                    thread.asleep_s = max(each.time_s, self.cycle_s)
                    break
                yield each
                if takes_time(each):
                    break

    def outside(self, name: str, given: list[Any], named: dict[str, Any], node: Any) -> Steps:
        if name.startswith(START):
            called = name.removeprefix(START)
            if called not in self.functions or len(self.threads) >= MOST_THREADS:
                self.fault(f"{called} cannot be run as a thread", node)
            handle = next(self.numbers)
            self.threads[handle] = Thread(self.call_user(called, given, named, node, 1))
            return handle
        if name in (KILL, JOIN):
            handle = int(number(given[0] if given else None, "a thread"))
            if name == KILL:
                self.threads.pop(handle, None)
            while handle in self.threads:
                yield Wait(node.lineno, self.cycle_s)
            return None
        return (yield from super().outside(name, given, named, node))


def takes_time(instruction: Instruction) -> bool:
    """Whether others may go on meanwhile."""
    return isinstance(instruction, (Move, Wait)) or (
        isinstance(instruction, SpeedJoints) and instruction.time_s is not None
    )
