"""Names in a program: which functions it calls anywhere, which variables its threads change."""

from __future__ import annotations

from truepath.programs.urscript.evaluate import word
from truepath.programs.urscript.moves import MOVES, NOT_CORRECTED
from truepath.programs.urscript.syntax import Node
from truepath.programs.urscript.tree import Statement

TO_A_TARGET = MOVES.keys() | NOT_CORRECTED
DEFINES = ("function", "thread", "secondary")


def all_statements(statements: list[Statement]) -> list[Statement]:
    """These and all inside them."""
    found = list(statements)
    for statement in found:  # grows while it is gone through
        found += statement.body
        if statement.otherwise is not None:
            found.append(statement.otherwise)
    return found


def called_anywhere(statements: list[Statement]) -> set[str]:
    """Functions that are called somewhere."""
    return {word(call, each.line) for each in all_statements(statements) for call in each.shape.calls}


def moves_in(statements: list[Statement]) -> set[int]:
    """Lines in which the robot is moved to a target."""
    found = set()
    for each in all_statements(statements):
        if each.shape.calls and any(word(call, each.line) in TO_A_TARGET for call in each.shape.calls):
            found.add(each.line.number)
    return found


def own_names(function: Statement) -> set[str]:
    """Names that a function can give values in a scope of its own."""
    found = {word(each.args[0] if each.op == "keyword" else each, function.line) for each in parameters(function)}
    for each in all_statements(function.body):
        if each.node.op == "assign":
            found.add(assigned(each))
    return found


def parameters(function: Statement) -> tuple[Node, ...]:
    """Of a function or thread."""
    return function.node.args[1] or () if function.node.op == "function" else ()


def assigned(statement: Statement) -> str:
    """The variable that an assignment changes, or an element of which; empty if there is none."""
    target = statement.node.args[1]
    while target.op in ("index", "member"):
        target = target.args[0]
    if target.op == "pose" and len(target.args[1] or ()) == 1:  # the variable that is called p, with an index
        return "p"
    return word(target, statement.line) if target.op == "name" else ""


def changed_by_threads(program: list[Statement]) -> set[str]:
    """Names to which threads, and the functions that these call, give values of their own."""
    run = run_by_threads(program)
    return {assigned(each) for each in run if each.node.op == "assign" and each.node.args[0] != "local"}


def called_by_threads(program: list[Statement]) -> set[str]:
    """Functions that threads, and the functions that these call, call."""
    return {word(call, each.line) for each in run_by_threads(program) for call in each.shape.calls}


def run_by_threads(program: list[Statement]) -> list[Statement]:
    """Statements of threads, and of the functions that these call."""
    everything = all_statements(program)
    functions = {word(each.node.args[0], each.line): each for each in everything if each.node.op in DEFINES}
    waiting = [each for each in functions.values() if each.node.op == "thread"]
    seen: set[int] = set()
    found: list[Statement] = []
    while waiting:
        function = waiting.pop()
        if id(function) in seen:
            continue
        seen.add(id(function))
        own = all_statements(function.body)
        found += own
        called = {word(call, each.line) for each in own for call in each.shape.calls}
        waiting += [functions[name] for name in called if name in functions]
    return found
