"""The value of an expression, as far as it is known before the program runs."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any, Protocol

from truepath.programs.urscript.slots import slots_of_target
from truepath.programs.urscript.source import Line
from truepath.programs.urscript.syntax import Node
from truepath.programs.urscript.values import (
    PURE,
    JointsOf,
    Pose,
    Unknown,
    Value,
    all_finite,
    call_pure,
    is_joints,
    is_number,
)
from truepath.programs.urscript.written import Written

COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
ARITHMETIC: dict[str, Callable[[Any, Any], float]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "modulo": math.fmod,
}
CONSTANTS: dict[str, Value] = {"pi": math.pi}
MOST_ELEMENTS = 100_000


class Asked(Protocol):
    """What an expression may ask of the program around it."""

    def variable(self, name: str) -> Value | Written: ...

    def call(self, node: Node, arguments: list[Value], keywords: dict[str, Value], line: Line) -> Value | Written: ...

    def forget(self, name: str, why: str) -> None: ...

    def perhaps(self, node: Node, line: Line) -> Value: ...

    def start_thread(self, name: str) -> None: ...

    def takes_literals(self, name: str) -> bool: ...

    def written(self, value: Value, node: Node, line: Line) -> Written: ...

    def used(self, value: Value | Written) -> Value: ...


def word(node: Node | str, line: Line) -> str:
    """A name, number or string as it stands in its line."""
    if isinstance(node, str):
        return node
    return line.slots[node.slot] if node.slot >= 0 else str(node.args[0])


def handed_on(node: Node, line: Line, scene: Asked) -> Value | Written:
    """The same as ``evaluate`` for who does nothing with a value but hand it on: a literal keeps its place."""
    op = node.op
    if op == "name":
        return _variable(word(node, line), scene)
    if op == "call":
        return _call(node, line, scene)
    slots = slots_of_target(node) if op in ("pose", "list_") else None
    if slots is not None:
        values = tuple([sign * _number(line.slots[slot]) for slot, sign in slots])
        if all(map(math.isfinite, values)):
            return scene.written(Pose(tuple(map(float, values))) if op == "pose" else values, node, line)
    value = evaluate(node, line, scene)
    if (op == "pose" and isinstance(value, Pose)) or (op == "list_" and is_joints(value)):
        return scene.written(value, node, line)
    return value


def evaluate(node: Node, line: Line, scene: Asked) -> Value:
    """A value, or Unknown with the reason."""
    op, args = node.op, node.args
    if op == "number":
        return _number(word(node, line))
    if op == "name":
        return scene.used(_variable(word(node, line), scene))
    if op == "pose":
        return _pose(args[1] or (), line, scene)
    if op == "list_":
        values = tuple(evaluate(each, line, scene) for each in args[0] or ())
        return next((value for value in values if isinstance(value, Unknown)), None) or _list(values)
    if op == "call":
        return scene.used(_call(node, line, scene))
    if op == "negative":
        value = evaluate(args[0], line, scene)
        return -value if is_number(value) else _cannot("-", value)
    if op in ARITHMETIC:
        return _arithmetic(op, evaluate(args[0], line, scene), evaluate(args[1], line, scene))
    if op == "string":
        return word(node, line)[1:-1]
    if op in ("true", "false"):
        return op == "true"
    if op == "index":
        return _index(evaluate(args[0], line, scene), [evaluate(each, line, scene) for each in args[1:]])
    return _rare(op, args, line, scene)


def _variable(name: str, scene: Asked) -> Value | Written:
    value = scene.variable(name)
    return CONSTANTS.get(name, Unknown(f"{name} is not set")) if value is None else value


def _rare(op: str, args: tuple[Any, ...], line: Line, scene: Asked) -> Value:
    if op == "compare":
        one, other = evaluate(args[0], line, scene), evaluate(args[2], line, scene)
        return _compare(str(args[1]), one, other)
    if op == "not_":
        value = evaluate(args[0], line, scene)
        return not value if isinstance(value, bool) else _cannot("not", value)
    if op in ("and_", "or_"):
        # Whether the second one is looked at, if the first decides, only the controller knows.
        return _logic(op, evaluate(args[0], line, scene), scene.perhaps(args[1], line))
    if op == "xor_":
        return _logic(op, evaluate(args[0], line, scene), evaluate(args[1], line, scene))
    if op == "method":
        for each in args[2] or ():
            evaluate(each.args[1] if each.op == "keyword" else each, line, scene)
        name, owner = word(args[1], line), args[0]
        while owner.op in ("index", "member", "method"):
            owner = owner.args[0]
        if owner.op == "name":
            scene.forget(word(owner, line), f"{word(owner, line)} is changed by {name}(), perhaps")
        return Unknown(f"{name}() is known to the controller only")
    if op == "of_threads":
        if args[0] == "run" and args[1].op == "call":
            scene.start_thread(word(args[1].args[0], line))
        return Unknown("threads are known when they run")
    return Unknown("members of a struct are not followed" if op == "member" else "this is not followed")


def _number(text: str) -> float:
    if text[:2] in ("0x", "0X"):
        return int(text, 16)
    return int(text) if text.isdigit() and len(text) < 16 else float(text)


def _pose(nodes: tuple[Node, ...], line: Line, scene: Asked) -> Value:
    values = [evaluate(each, line, scene) for each in nodes]
    if len(values) == 1:  # the variable that is called p, with an index
        return _index(scene.used(_variable("p", scene)), values)
    for value in values:
        if isinstance(value, Unknown):
            return value
    if len(values) != 6 or not all(is_number(value) and math.isfinite(value) for value in values):
        return Unknown("a pose has six finite numbers")
    return Pose(tuple(float(value) for value in values))


def _list(values: tuple[Value, ...]) -> Value:
    """A list as long and as deep as the language has any use for: lists in lists in lists grow without end."""
    inner = [value for value in values if isinstance(value, tuple)]
    if sum(map(len, inner)) > MOST_ELEMENTS or any(isinstance(each, tuple) for value in inner for each in value):
        return Unknown("lists in lists in lists are not followed")
    return values


def _call(node: Node, line: Line, scene: Asked) -> Value:
    arguments, keywords = [], {}
    value_of = handed_on if scene.takes_literals(word(node.args[0], line)) else evaluate
    for each in node.args[1] or ():
        if each.op == "keyword":
            keywords[word(each.args[0], line)] = value_of(each.args[1], line, scene)
        else:
            arguments.append(value_of(each, line, scene))
    return scene.call(node, arguments, keywords, line)


def built_in(name: str, arguments: list[Value], keywords: dict[str, Value]) -> Value | None:
    """The value of a function of the language; None where there is no such function here."""
    if name == "get_inverse_kin":
        names = ("x", "qnear", "maxPositionError", "maxOrientationError", "tcp")
        given = dict(zip(names, arguments, strict=False)) | keywords
        return _joints_of(given)
    if name not in PURE:
        return None
    for value in (*arguments, *keywords.values()):
        if isinstance(value, Unknown):
            return value
    return Unknown(f"{name}() takes no names") if keywords else call_pure(name, arguments)


def _joints_of(given: dict[str, Value]) -> Value:
    pose, near, tool = given.get("x"), given.get("qnear"), given.get("tcp")
    for value in (pose, near, tool):
        if isinstance(value, Unknown):
            return value
    if not isinstance(pose, Pose) or not (tool is None or isinstance(tool, Pose)):
        return Unknown("get_inverse_kin() is called with something else than it takes")
    if near is not None and not (is_joints(near) and all_finite(near)):
        return Unknown("get_inverse_kin() needs six joints to be near to")
    return JointsOf(pose, None if near is None else tuple(float(each) for each in near), tool)


def _arithmetic(op: str, one: Value, other: Value) -> Value:
    if not (is_number(one) and is_number(other)):
        return _cannot(op, one, other)
    try:
        value = ARITHMETIC[op](one, other)
    except (ZeroDivisionError, ValueError, OverflowError):
        return Unknown(f"to {op} has no result here")
    # Numbers without end grow without end when a program is followed, so only those that a float can hold go on.
    return value if all_finite(value) and abs(value) < 1e300 else Unknown(f"to {op} has no result here")


def _compare(sign: str, one: Value, other: Value) -> Value:
    for value in (one, other):
        if isinstance(value, (Unknown, JointsOf)):
            return _cannot(sign, value)
    ordered = is_number(one) and is_number(other)
    if not ordered and sign not in ("==", "!="):
        return _cannot(sign, one, other)
    return COMPARE[sign](one, other)


def _logic(op: str, one: Value, other: Value) -> Value:
    decisive = {"and_": False, "or_": True}.get(op)
    if decisive is not None and (one is decisive or other is decisive):
        return decisive
    if not (isinstance(one, bool) and isinstance(other, bool)):
        return _cannot(op.rstrip("_"), one, other)
    return {"and_": one and other, "or_": one or other, "xor_": one != other}[op]


def _index(value: Value, indices: list[Value]) -> Value:
    for index in indices:
        if isinstance(value, (Unknown, JointsOf)) or isinstance(index, Unknown):
            return _cannot("[]", value, index)
        numbers = value.values if isinstance(value, Pose) else value
        if not isinstance(numbers, tuple) or not is_number(index) or index != int(index):
            return Unknown("there is nothing to be taken by this index")
        if not 0 <= index < len(numbers):
            return Unknown(f"there is no element {int(index)}")
        value = numbers[int(index)]
    return value


def with_element(value: Value, indices: list[Value], element: Value) -> Value:
    """A list or pose with one element replaced."""
    if not indices:
        return element
    index, inner = indices[0], _index(value, indices[:1])
    for each in (value, index, inner, element):
        if isinstance(each, (Unknown, JointsOf)):
            return _cannot("[]", each)
    numbers = value.values if isinstance(value, Pose) else value
    changed = with_element(inner, indices[1:], element)
    if isinstance(changed, Unknown):
        return changed
    if not isinstance(value, Pose):
        return _list((*numbers[: int(index)], changed, *numbers[int(index) + 1 :]))
    if not is_number(changed) or not math.isfinite(changed):
        return Unknown("a pose has six finite numbers")
    return Pose((*numbers[: int(index)], float(changed), *numbers[int(index) + 1 :]))


def _cannot(what: str, *values: Value) -> Unknown:
    for value in values:
        if isinstance(value, Unknown):
            return value
    if any(isinstance(value, JointsOf) for value in values):
        return Unknown("the joints that get_inverse_kin() finds are known to the controller only")
    return Unknown(f"'{what}' is not followed for these values")
