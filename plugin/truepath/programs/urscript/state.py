"""What is known at a point of a program, and what is left of it where ways meet."""

from __future__ import annotations

from dataclasses import dataclass, field

from truepath.programs.urscript.moves import Step
from truepath.programs.urscript.tree import Statement
from truepath.programs.urscript.values import Unknown, Value
from truepath.programs.urscript.written import Key, Written, plain

Name = tuple[int, str]  # scope, name
START, ELSEWHERE = (0, 0), (0, 1)  # in place of a move: the program has just begun; nobody knows where the robot is
AT_THE_START, ANYWHERE = frozenset({START}), frozenset({ELSEWHERE})
MOST_WAYS = 16


@dataclass(slots=True)
class State:
    """Values of variables by scope and name, the tool in force, and the moves that may have been made last."""

    tool: Value
    values: dict[Name, Value] = field(default_factory=dict)
    last: frozenset[Step] = AT_THE_START

    def copy(self) -> State:
        return State(self.tool, dict(self.values), self.last)

    def take(self, other: State) -> None:
        """Becomes the other."""
        self.tool, self.values, self.last = other.tool, other.values, other.last


@dataclass(slots=True, eq=False)
class Frame:
    """A call under way.

    Attributes:
        scopes: of variables, from the inside out.
        home: call in which the function was defined; None for the program.
        functions: that are defined in it.
        returned, breaks, continues: states in which it, or the loop that it is in, was left.
    """

    scopes: tuple[int, ...]
    home: Frame | None
    functions: dict[str, tuple[Statement, Frame]] = field(default_factory=dict)
    returned: list[tuple[State, Value | Written]] = field(default_factory=list)
    breaks: list[State] = field(default_factory=list)
    continues: list[State] = field(default_factory=list)

    def function(self, name: str) -> tuple[Statement, Frame] | None:
        """The function of that name that is seen from here, and the call in which it was defined."""
        frame: Frame | None = self
        while frame is not None:
            if name in frame.functions:
                return frame.functions[name]
            frame = frame.home
        return None


def joined(states: list[State], used: set[Key]) -> State:
    """What holds in all of these; what differs is not known. Literals that can no longer be told apart are used."""
    first = states[0].copy()
    for other in states[1:]:
        first.last |= other.last
        if len(first.last) > MOST_WAYS:
            first.last = frozenset({*sorted(first.last)[:MOST_WAYS], ELSEWHERE})
        if not _same(first.tool, other.tool):
            first.tool = Unknown("the program comes here with several tools (set_tcp)")
        if first.values == other.values:
            continue
        different = [name for name, value in other.values.items() if first.values.get(name) is not value]
        for name in different + [name for name in first.values if name not in other.values]:
            one, two = first.values.get(name), other.values.get(name)
            if not _same(one, two):
                literals = _literals(one) | _literals(two)
                if _same(plain(one), plain(two)):  # written in two places
                    used |= literals
                    first.values[name] = plain(one)
                else:
                    first.values[name] = _differs(name[1], one, two, literals)
    return first


def _same(one: Value, two: Value) -> bool:
    return type(one) is type(two) and one == two


def _literals(value: Value | Written) -> frozenset[Key]:
    if isinstance(value, Written):
        return frozenset({value.key})
    return value.literals if isinstance(value, Unknown) else frozenset()


def _differs(name: str, one: Value, two: Value, literals: frozenset[Key]) -> Unknown:
    for value in (one, two):
        if isinstance(value, Unknown):
            return Unknown(value.why, literals)
    return Unknown(f"{name} has several values, depending on the way that the program takes", literals)
