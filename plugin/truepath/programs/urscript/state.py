"""What is known at a point of a program, and what is left of it where ways meet."""

from __future__ import annotations

from dataclasses import dataclass, field

from truepath.programs.urscript.moves import Key
from truepath.programs.urscript.values import Unknown, Value

Name = tuple[int, str]  # scope, name
START, ELSEWHERE = (0, 0), (0, 1)  # in place of a move: the program has just begun; nobody knows where the robot is
AT_THE_START, ANYWHERE = frozenset({START}), frozenset({ELSEWHERE})
MOST_WAYS = 16


@dataclass(slots=True)
class State:
    """Values of variables by scope and name, the tool in force, and the moves that may have been made last."""

    tool: Value
    values: dict[Name, Value] = field(default_factory=dict)
    last: frozenset[Key] = AT_THE_START

    def copy(self) -> State:
        return State(self.tool, dict(self.values), self.last)

    def take(self, other: State) -> None:
        """Becomes the other."""
        self.tool, self.values, self.last = other.tool, other.values, other.last


def joined(states: list[State]) -> State:
    """What holds in all of these; what differs is not known."""
    first = states[0].copy()
    for other in states[1:]:
        first.last |= other.last
        if len(first.last) > MOST_WAYS:
            first.last = frozenset({*sorted(first.last)[:MOST_WAYS], ELSEWHERE})
        if not _same(first.tool, other.tool):
            first.tool = Unknown("the program comes here with several tools (set_tcp)")
        if first.values == other.values:
            continue
        for name in first.values.keys() | other.values.keys():
            one, two = first.values.get(name), other.values.get(name)
            if not _same(one, two):
                first.values[name] = _differs(name[1], one, two)
    return first


def _same(one: Value, two: Value) -> bool:
    return type(one) is type(two) and one == two


def _differs(name: str, one: Value, two: Value) -> Unknown:
    for value in (one, two):
        if isinstance(value, Unknown):
            return value
    return Unknown(f"{name} has several values, depending on the way that the program takes")
