"""Expressions of a running program, calls of its functions among them. Nothing in it is executed by Python."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Generator, Iterable
from typing import Any, NoReturn

from truepath.virtual.controller.script_instructions import Instruction, ScriptError
from truepath.virtual.controller.script_syntax import POSE
from truepath.virtual.controller.script_values import (
    FUNCTIONS,
    Joints,
    Pose,
    as_list,
    as_pose,
    checked,
    is_number,
    matrix,
    vector,
)

Steps = Generator[Instruction, None, Any]
DEEPEST_CALL = 60
STEPS_OF_A_FUNCTION, STEPS_OF_KINEMATICS = 20, 1000
ARITHMETIC: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.BitXor: lambda a, b: bool(a) != bool(b),
}
COMPARISON: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
BOTH_WAYS = (ast.Eq, ast.NotEq)  # compare anything


class Leave(BaseException):
    """The way out of a loop, a function or the program; no error."""

    def __init__(self, how: str, value: Any = None) -> None:
        self.how, self.value = how, value


class Scope(dict[str, Any]):
    """Variables of a call; ``depth`` counts the calls that it is in, 0 outside of all functions."""

    depth = 0


class Expressions:
    """Values of expressions in one run of a program; what asks the world is a matter of subclasses.

    A generator, as all of a run is: a function that is called in an expression can move the robot.

    Attributes:
        tool: X_0T in force, as a pose.
        most_steps: after so many without a pause the program is taken to be endless; None: never.
    """

    most_steps: int | None = None

    def __init__(self, tool: Iterable[float]) -> None:
        self.globals, self.functions = Scope(), dict[str, ast.FunctionDef]()
        self.tool = Pose(tool)
        self.steps = 0

    # --- for subclasses

    def block(self, nodes: list[ast.stmt], scope: Scope) -> Steps:
        """Runs statements."""
        raise NotImplementedError

    def outside(self, name: str, given: list[Any], named: dict[str, Any], node: ast.Call) -> Steps:
        """A function that the program does not define and that is no mathematics; yields what it does."""
        raise NotImplementedError

    def undefined(self, name: str, node: ast.expr) -> Any:
        """The value of a name that the program does not define."""
        raise NotImplementedError

    def forward(self, q_rad: Any) -> Any:
        """``(4, 4)`` X_C0 at joints ``(6,)``."""
        raise NotImplementedError

    # --- values

    def fault(self, reason: str, node: ast.AST | None = None) -> NoReturn:
        raise ScriptError(reason, getattr(node, "lineno", None))

    def spend(self, steps: int, node: ast.AST) -> None:
        self.steps += steps
        if self.most_steps is not None and self.steps > self.most_steps:
            self.fault("an endless loop: nothing in it takes time", node)

    def value(self, node: ast.expr | None, scope: Scope) -> Steps:
        assert node is not None
        self.spend(1, node)
        match node:
            case ast.Constant():
                if not isinstance(node.value, (bool, int, float, str)):
                    self.fault("this is no value of URScript", node)
                return checked(node.value)
            case ast.Name():
                known = scope if node.id in scope else self.globals
                return known[node.id] if node.id in known else self.undefined(node.id, node)
            case ast.List() | ast.Tuple():
                return self.written(as_list((yield from self.values(node.elts, scope))), node)
            case ast.Subscript(value=ast.Name(id=word), slice=ast.Tuple()) if word == POSE:
                return self.written(as_pose((yield from self.value(node.slice, scope))), node)
            case ast.Subscript(value=ast.Name(id=word)) if word == POSE:
                whole = scope.get("p", self.globals.get("p", Joints()))
                return whole[(yield from self.index(whole, node.slice, scope))]
            case ast.Subscript():
                whole = yield from self.value(node.value, scope)
                return whole[(yield from self.index(whole, node.slice, scope))]
            case ast.UnaryOp(op=ast.Not()):
                return not (yield from self.value(node.operand, scope))
            case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
                inner = yield from self.value(node.operand, scope)
                if not is_number(inner):
                    self.fault("a sign before what is no number", node)
                return -inner if isinstance(node.op, ast.USub) else inner
            case ast.BoolOp():
                values = yield from self.values(node.values, scope)  # all of them, as a controller does
                return all(values) if isinstance(node.op, ast.And) else any(values)
            case ast.BinOp():
                left = yield from self.value(node.left, scope)
                right = yield from self.value(node.right, scope)
                return self.combined(node, ARITHMETIC.get(type(node.op)), left, right)
            case ast.Compare(ops=[op], comparators=[right_node]):
                left = yield from self.value(node.left, scope)
                right = yield from self.value(right_node, scope)
                if not isinstance(op, BOTH_WAYS) and not (is_number(left) and is_number(right)):
                    self.fault("only numbers can be larger or smaller", node)
                compare = COMPARISON.get(type(op))
                return bool(compare(left, right)) if compare else self.fault("this is no comparison", node)
            case ast.Call(func=ast.Name()):
                return (yield from self.call(node, scope))
        self.fault("this is no expression of URScript", node)

    def index(self, whole: Any, node: ast.expr, scope: Scope) -> Steps:
        at = yield from self.value(node, scope)
        if not isinstance(whole, Joints) or not is_number(at) or not 0 <= int(at) < len(whole):
            self.fault("there is no such element", node)
        return int(at)

    def values(self, nodes: list[ast.expr], scope: Scope) -> Steps:
        found: list[Any] = [None] * len(nodes)
        for at, node in enumerate(nodes):
            found[at] = yield from self.value(node, scope)
        return found

    def combined(self, node: ast.BinOp, how: Callable[[Any, Any], Any] | None, left: Any, right: Any) -> Any:
        if how is None or not all(isinstance(each, (bool, int, float)) for each in (left, right)):
            self.fault("this cannot be computed", node)
        try:
            return checked(how(left, right))
        except ArithmeticError:
            self.fault("this has no value", node)

    def written(self, value: Joints, node: ast.expr) -> Joints:
        value.line = node.lineno
        return value

    # --- calls

    def call(self, node: ast.Call, scope: Scope) -> Steps:
        assert isinstance(node.func, ast.Name)
        name, named = node.func.id, {}
        given = yield from self.values(node.args, scope)
        for keyword in node.keywords:
            if keyword.arg is None:
                self.fault("this is no argument", node)
            named[keyword.arg] = yield from self.value(keyword.value, scope)
        if name in self.functions:
            return (yield from self.call_user(name, given, named, node, scope.depth))
        if name in FUNCTIONS or (name == "get_forward_kin" and given):
            self.spend(STEPS_OF_A_FUNCTION if name in FUNCTIONS else STEPS_OF_KINEMATICS, node)
            try:
                found = FUNCTIONS[name](*given, **named) if name in FUNCTIONS else self.flange(given)
                return as_pose(found) if isinstance(found, Pose) else checked(found)
            except (ArithmeticError, TypeError, ValueError, IndexError, AttributeError):
                self.fault(f"{name}() has no value for this", node)
        return (yield from self.outside(name, given, named, node))

    def flange(self, given: list[Any]) -> Pose:
        """Where the tool is at joints; the one that is stated, or the one in force."""
        return vector(self.forward(given[0]) @ matrix(given[1] if len(given) > 1 else self.tool))

    def call_user(
        self, name: str, given: list[Any], named: dict[str, Any], node: ast.expr | ast.FunctionDef, depth: int
    ) -> Steps:
        function = self.functions[name]
        parameters = [parameter.arg for parameter in function.args.args]
        if depth >= DEEPEST_CALL:
            self.fault("functions call each other without end", node)
        if len(given) > len(parameters) or not named.keys() <= set(parameters):
            self.fault(f"{name}() has more arguments than it takes", node)
        scope = Scope()
        scope.depth = depth + 1
        for parameter, default in zip(reversed(parameters), reversed(function.args.defaults), strict=False):
            scope[parameter] = yield from self.value(default, self.globals)
        scope.update(zip(parameters, given, strict=False))
        scope.update(named)
        if len(scope) < len(parameters):
            self.fault(f"{name}() lacks an argument", node)
        try:
            yield from self.block(function.body, scope)
        except Leave as leave:
            if leave.how != "return":
                raise
            return leave.value
        return None
