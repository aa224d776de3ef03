"""Moves of URScript: what their arguments mean, and every move that a program can make, noted while it is followed."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

from truepath.programs.motions import Kind
from truepath.programs.urscript.source import Line
from truepath.programs.urscript.syntax import Node, Shape
from truepath.programs.urscript.tree import Statement
from truepath.programs.urscript.values import JointsOf, Pose, Unknown, Value, is_joints

Key = tuple[int, int]  # line, column of the call in the shape


@dataclass(frozen=True)
class Signature:
    """Arguments of a move in their order, and what its targets are for."""

    arguments: tuple[str, ...]
    kinds: tuple[Kind, ...]

    @property
    def targets(self) -> tuple[str, ...]:
        return self.arguments[: len(self.kinds)]


MOVES = {
    "movej": Signature(("q", "a", "v", "t", "r"), (Kind.JOINT,)),
    "movel": Signature(("pose", "a", "v", "t", "r"), (Kind.LINEAR,)),
    "movep": Signature(("pose", "a", "v", "r"), (Kind.PROCESS,)),
    "movec": Signature(("pose_via", "pose_to", "a", "v", "r", "mode"), (Kind.THROUGH, Kind.ARC)),
    "servoj": Signature(("q", "a", "v", "t", "lookahead_time", "gain"), (Kind.SERVO,)),
}
# After these nobody knows where the robot is.
LEAD_ELSEWHERE = {
    "speedj", "speedl", "servoc", "servol", "freedrive_mode", "teach_mode", "end_teach_mode", "end_freedrive_mode",
    "force_mode", "screw_driving", "path_offset_set", "track_conveyor_linear", "track_conveyor_circular",
    "stop_conveyor_tracking", "stopj", "stopl", "optimovej", "optimovel",
}  # fmt: skip


@dataclass(slots=True, eq=False)
class Move:
    """One call of a move, and all that it can mean.

    Attributes:
        name: of the function.
        node, statement: where it is written.
        targets: value of each target; empty where all arguments are plain numbers, see ``literal``.
        settings: values of the other arguments that are stated.
        tool: in force.
        previous: the moves from which the robot can come.
        origin: one of these that was made before this one; None if there is none.
        problem: why it cannot be resolved.
    """

    name: str
    node: Node
    statement: Statement
    targets: tuple[Value, ...]
    settings: dict[str, Value]
    tool: Value
    previous: frozenset[Key]
    problem: str | None = None
    origin: Key | None = None

    @property
    def line(self) -> Line:
        return self.statement.line

    def merge(self, other: Move) -> None:
        """It is made again, perhaps otherwise."""
        if self.targets != other.targets:
            self.problem = self.problem or other.problem or "its target takes several values while the program runs"
        if self.tool != other.tool:
            self.problem = self.problem or "it is made with several tools (set_tcp)"
        self.problem = self.problem or other.problem
        self.previous |= other.previous
        self.settings = {
            name: value for name, value in self.settings.items() if other.settings.get(name, None) == value
        }


@dataclass
class Moves:
    """All moves, by where they are written."""

    by_key: dict[Key, Move] = field(default_factory=dict)

    def note(self, key: Key, move: Move) -> None:
        known = self.by_key.get(key)
        if known is None:
            move.origin = min((each for each in move.previous if each in self.by_key), default=None)
            self.by_key[key] = move
        else:
            known.merge(move)


@dataclass(frozen=True)
class Literal:
    """A move all of whose arguments are plain numbers: slots and signs of each."""

    name: str
    node: Node
    is_pose: tuple[bool, ...]
    targets: tuple[tuple[tuple[int, float], ...], ...]
    settings: dict[str, tuple[int, float]]


@lru_cache(maxsize=20_000)
def literal(shape: Shape) -> Literal | None:
    """The move that a line of this shape is, if its arguments are plain numbers and nothing else stands there."""
    if len(shape.items) != 1 or shape.items[0].op != "expression" or shape.items[0].args[0].op != "call":
        return None
    call = shape.items[0].args[0]
    name = call.args[0]
    if not isinstance(name, str) or name not in MOVES:
        return None
    signature = MOVES[name]
    given = named(signature, call)
    if given is None or any(target not in given for target in signature.targets):
        return None
    targets, poses = [], []
    for target in signature.targets:
        node = given[target]
        elements = node.args[1] if node.op == "pose" else node.args[0] if node.op == "list_" else ()
        numbers = [_signed(each) for each in elements or ()]
        if len(numbers) != 6 or None in numbers:
            return None
        targets.append(tuple(number for number in numbers if number))
        poses.append(node.op == "pose")
    settings = {each: _signed(node) for each, node in given.items() if each not in signature.targets}
    if None in settings.values():
        return None
    plain = {each: number for each, number in settings.items() if number is not None}
    return Literal(name, call, tuple(poses), tuple(targets), plain)


def named(signature: Signature, call: Node) -> dict[str, Node] | None:
    """Argument nodes of a call by their names; None where there are more than the function takes."""
    given: dict[str, Node] = {}
    for index, each in enumerate(call.args[1] or ()):
        if each.op == "keyword":
            if not isinstance(each.args[0], str):
                return None
            given[each.args[0]] = each.args[1]
        elif index < len(signature.arguments):
            given[signature.arguments[index]] = each
        else:
            return None
    return given


def _signed(node: Node) -> tuple[int, float] | None:
    if node.op == "number" and not str(node.args[0]).startswith(("0x", "0X")):
        return node.slot, 1.0
    if node.op == "negative" and node.args[0].op == "number":
        inner = _signed(node.args[0])
        return None if inner is None else (inner[0], -1.0)
    return None


def problem_of(name: str, targets: tuple[Value, ...], tool: Value) -> str | None:
    """Why a move with these targets cannot be resolved, if so."""
    for value in targets:
        if isinstance(value, Unknown):
            return value.why
        if isinstance(value, JointsOf) and isinstance(value.tool, Unknown):
            return value.tool.why
        fits = isinstance(value, JointsOf) or is_joints(value) or (isinstance(value, Pose) and name != "servoj")
        if not fits:
            return "its target is neither six joints nor a pose"
    if isinstance(tool, Unknown) and any(isinstance(value, (Pose, JointsOf)) for value in targets):
        return f"the tool is not known: {tool.why}"
    return None
