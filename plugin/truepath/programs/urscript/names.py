"""Names in a program: which functions it calls anywhere, which variables its threads change."""

from __future__ import annotations

from truepath.programs.urscript.evaluate import word
from truepath.programs.urscript.tree import Statement

DEFINES = ("function", "thread", "secondary")


def all_statements(statements: list[Statement]) -> list[Statement]:
    """These and all inside them."""
    found: list[Statement] = []
    for statement in statements:
        found.append(statement)
        found += all_statements(statement.body)
        if statement.otherwise is not None:
            found += all_statements([statement.otherwise])
    return found


def called_anywhere(statements: list[Statement]) -> set[str]:
    """Functions that are called somewhere."""
    return {word(call, each.line) for each in all_statements(statements) for call in each.shape.calls}


def changed_by_threads(program: list[Statement]) -> set[str]:
    """Names to which threads, and the functions that these call, give values of their own."""
    everything = all_statements(program)
    functions = {word(each.node.args[0], each.line): each for each in everything if each.node.op in DEFINES}
    waiting = [each for each in functions.values() if each.node.op == "thread"]
    seen: set[int] = set()
    changed: set[str] = set()
    while waiting:
        function = waiting.pop()
        if id(function) in seen:
            continue
        seen.add(id(function))
        for each in all_statements(function.body):
            if each.node.op == "assign" and each.node.args[0] != "local":
                target = each.node.args[1]
                while target.op in ("index", "member"):
                    target = target.args[0]
                changed.add("p" if target.op == "pose" else word(target, each.line))
            waiting += [functions[name] for name in (word(c, each.line) for c in each.shape.calls) if name in functions]
    return changed
