"""A call of a move, as it is noted."""

from __future__ import annotations

from collections.abc import Callable

from truepath.programs.urscript.moves import MOVES, TURNING, Literal, Move, Step, named, problem_of
from truepath.programs.urscript.syntax import Node
from truepath.programs.urscript.tree import Statement
from truepath.programs.urscript.values import JointsOf, Unknown, Value
from truepath.programs.urscript.written import Written, plain

NO_SETTINGS: dict[str, Value] = {}


def move_of(
    name: str,
    node: Node,
    statement: Statement,
    arguments: list[Value],
    keywords: dict[str, Value],
    tool: Value,
    last: frozenset[Step],
    used: Callable[[Value | Written], Value],
) -> tuple[Step, Move]:
    """A move and what it takes.

    Args:
        name: of the function.
        node, statement: the call.
        arguments, keywords: their values.
        tool: in force.
        last: moves from which the robot can come.
        used: is told of literals that serve for something else than its one target.
    """
    signature, line = MOVES[name], statement.line
    given = dict(zip(signature.arguments, arguments, strict=False)) | keywords
    written = [given.pop(target, Unknown("it names no target")) for target in signature.targets]
    targets = tuple(map(plain, written))
    problem = problem_of(name, targets, tool)
    if named(signature, node) is None:
        problem = problem or f"{name}() has more arguments than it takes"
    mode = plain(given.get(TURNING, 0))
    if name == "movec" and mode != 0:
        stated = "which is not known" if isinstance(mode, Unknown) else f"{mode}"
        problem = problem or f"its mode is {stated}: the tool turns with the arc, which is not followed"
    if len(targets) == 1 and isinstance(targets[0], JointsOf) and targets[0].tool is not None:
        tool = targets[0].tool
    elsewhere = [each for each in written if isinstance(each, Written) and not each.is_part_of(node, line)]
    taken = elsewhere[0] if elsewhere and len(targets) == 1 and problem is None else None
    step: Step = (line.number, node.start)
    if taken is not None:
        step = (*step, *taken.key)
    else:
        for each in elsewhere:
            used(each)
    settings = {each: used(value) for each, value in given.items()}
    return step, Move(name, node, statement, targets, settings, tool, last, problem, taken)


def move_of_literal(known: Literal, statement: Statement, tool: Value, last: frozenset[Step]) -> tuple[Step, Move]:
    """A move all of whose arguments are plain numbers."""
    problem = f"the tool is not known: {tool.why}" if isinstance(tool, Unknown) and any(known.is_pose) else None
    step = (statement.line.number, known.node.start)
    return step, Move(known.name, known.node, statement, (), NO_SETTINGS, tool, last, problem)
