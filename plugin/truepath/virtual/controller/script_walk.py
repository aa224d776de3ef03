"""Walks through a program: its statements, loops and variables. Nothing in it is executed by Python.

What a program does to the world, and what it asks of it, is a matter of subclasses.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable
from typing import Any

from truepath.virtual.controller.script_expressions import Expressions, Leave, Scope, Steps
from truepath.virtual.controller.script_instructions import ScriptError
from truepath.virtual.controller.script_syntax import POSE, Syntax
from truepath.virtual.controller.script_values import Joints, Pose, as_list, as_pose, copied


class Walk(Expressions):
    """One run of a program."""

    def __init__(self, syntax: Syntax, tool: Iterable[float]) -> None:
        super().__init__(tool)
        self.syntax = syntax

    def turns(self, endless: bool) -> Iterable[int]:
        """Counts the turns of a loop, as many as it may make; ``endless`` if its condition is a constant."""
        raise NotImplementedError

    def program(self) -> Steps:
        """All of it: statements that stand in no function, or else the one function that is the program."""
        try:
            yield from self.block(self.syntax.body, self.globals)
            if not self.syntax.bare:
                main = [node for node in self.syntax.programs if node.name not in self.syntax.secondary]
                main = main or self.syntax.programs
                if len(main) != 1:
                    raise ScriptError(f"{len(main)} programs in one text")
                yield from self.call_user(main[0].name, [], {}, main[0], 0)
        except Leave as leave:
            if leave.how != "halt":
                self.fault(f"{leave.how} where there is nothing to leave")

    def block(self, nodes: list[ast.stmt], scope: Scope) -> Steps:
        for node in nodes:
            yield from self.statement(node, scope)

    def statement(self, node: ast.stmt, scope: Scope) -> Steps:
        self.spend(1, node)
        match node:
            case ast.FunctionDef():
                self.functions[node.name] = node
            case ast.Pass():
                pass
            case ast.AnnAssign(target=ast.Name(id=name), annotation=ast.Name(id="global_" | "local_" as where)):
                value = yield from self.value(node.value, scope)
                (self.globals if where == "global_" else scope)[name] = value
            case ast.Assign(targets=[target]):
                value = yield from self.value(node.value, scope)
                yield from self.assign(target, value, scope)
            case ast.Expr(value=ast.Name(id="halt")):
                raise Leave("halt")
            case ast.Expr():
                yield from self.value(node.value, scope)
            case ast.Return():
                raise Leave("return", None if node.value is None else (yield from self.value(node.value, scope)))
            case ast.Break():
                raise Leave("break")
            case ast.Continue():
                raise Leave("continue")
            case ast.If():
                yield from self.branch(node, scope)
            case ast.While():
                yield from self.loop(node, scope)
            case _:
                self.fault("this is no statement of URScript", node)

    def branch(self, node: ast.If, scope: Scope) -> Steps:
        while True:
            if (yield from self.value(node.test, scope)):
                return (yield from self.block(node.body, scope))
            if len(node.orelse) != 1 or not isinstance(node.orelse[0], ast.If):
                return (yield from self.block(node.orelse, scope))
            node = node.orelse[0]  # elif, however many

    def loop(self, node: ast.While, scope: Scope) -> Steps:
        for _ in self.turns(isinstance(node.test, ast.Constant)):
            if not (yield from self.value(node.test, scope)):
                return
            try:
                yield from self.block(node.body, scope)
            except Leave as leave:
                if leave.how == "break":
                    return
                if leave.how != "continue":
                    raise

    def assign(self, target: ast.expr, value: Any, scope: Scope) -> Steps:
        """Values are copied: URScript has no references."""
        value = copied(value)
        match target:
            case ast.Subscript(value=ast.Name(id=name)):
                name = "p" if name == POSE else name  # a variable of that name, with an index
                where = scope if name in scope else self.globals
                if not isinstance(where.get(name), Joints):
                    self.fault(f"{name} is no list", target)
                changed = copied(where[name])
                changed[(yield from self.index(changed, target.slice, scope))] = value
                changed.line = None
                where[name] = as_pose(changed) if isinstance(changed, Pose) else as_list(changed)
            case ast.Name(id=name) if name not in scope and (name in self.globals or scope.depth <= 1):
                self.globals[name] = value  # what the program's first level assigns is global
            case ast.Name(id=name):
                scope[name] = value
            case _:
                self.fault("nothing can be assigned to this", target)
