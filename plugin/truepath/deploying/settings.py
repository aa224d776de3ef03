"""What the text of a program sets with plain numbers, wherever it stands: also beyond what a rehearsal can know."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from truepath.virtual.controller.script_instructions import ScriptError, SetPayload, SetTcp
from truepath.virtual.controller.script_syntax import POSE, read_syntax
from truepath.virtual.controller.script_values import number, six

PAYLOAD, TOOL = ("set_payload", "set_target_payload", "set_payload_mass"), ("set_tcp",)


@dataclass(frozen=True)
class Settings:
    """In the order of the text.

    Attributes:
        payloads, tools: set with plain numbers.
        unclear: lines that set a payload or a tool in another way.
    """

    payloads: tuple[SetPayload, ...] = ()
    tools: tuple[SetTcp, ...] = ()
    unclear: tuple[int, ...] = ()


def settings_in(text: str) -> Settings:
    """Looks through a program; nothing of it is run.

    Raises:
        ScriptError: it is none.
    """
    payloads: list[SetPayload] = []
    tools: list[SetTcp] = []
    unclear: list[int] = []
    for call, name in sorted(_calls(text), key=lambda each: each[0].lineno):
        try:
            given = [_plain(each) for each in call.args]
            named = {each.arg: _plain(each.value) for each in call.keywords}
            if name in TOOL:
                tools.append(SetTcp(call.lineno, six((given or [named.get("pose")])[0])))
            else:
                mass, centre = (*given, named.get("m"))[0], (*given[1:2], named.get("cog"))[0]
                payloads.append(SetPayload(call.lineno, number(mass, "the payload", 0.0), _three(centre)))
        except (ScriptError, ValueError, TypeError, OverflowError, RecursionError):  # whatever it is, it is told
            unclear.append(call.lineno)
    return Settings(tuple(payloads), tuple(tools), tuple(unclear))


def _calls(text: str) -> Iterator[tuple[ast.Call, str]]:
    for statement in read_syntax(text).body:
        for node in ast.walk(statement):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in (*PAYLOAD, *TOOL):
                yield node, node.func.id


def _plain(node: ast.expr) -> Any:
    """A number, or a list or pose of numbers.

    Raises:
        ValueError: it is computed.
    """
    match node:
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Tuple(elts=elements)) if name == POSE:
            return [_plain(each) for each in elements]
        case ast.List(elts=elements):
            return [_plain(each) for each in elements]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_plain(operand)
        case ast.Constant(value=bool()):
            raise ValueError
        case ast.Constant(value=int() | float() as value):
            return value
    raise ValueError


def _three(centre: Any) -> tuple[float, float, float] | None:
    if centre is None:
        return None
    x, y, z = (number(each, "the centre of gravity") for each in centre)
    return x, y, z
