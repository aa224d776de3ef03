"""Moves of URScript: what their arguments mean, and every move that a program can make, noted while it is followed."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

from truepath.programs.motions import Kind
from truepath.programs.urscript.slots import SlotOf, signed_slot, slots_of_target
from truepath.programs.urscript.source import Line
from truepath.programs.urscript.syntax import Node, Shape
from truepath.programs.urscript.tree import Statement
from truepath.programs.urscript.values import JointsOf, Pose, Unknown, Value, is_joints, is_number
from truepath.programs.urscript.written import Key, Written

# Line and column of the call, and of the literal elsewhere that it takes as its target, if it takes one.
Step = tuple[int, ...]


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
SET_TOOL = "set_tcp"
NOT_CORRECTED = {"servoc", "servol", "optimovej", "optimovel"}  # they have targets, but stay as they are
TURNING = "mode"  # of movec: anything but 0 makes the tool turn with the arc, whatever pose its end states
# After these nobody knows where the robot is,
LEAD_ELSEWHERE = {
    "speedj", "freedrive_mode", "teach_mode", "end_teach_mode", "end_freedrive_mode", "stopj", "optimovej", "optimovel",
}  # fmt: skip
# and after these not quite: the tool was pushed along or held up, in the posture that it had.
LEAD_ASIDE = {
    "speedl", "servoc", "servol", "force_mode", "screw_driving", "path_offset_set", "track_conveyor_linear",
    "track_conveyor_circular", "stop_conveyor_tracking", "stopl",
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
        literal: its target, where that was written elsewhere and handed on.
    """

    name: str
    node: Node
    statement: Statement
    targets: tuple[Value, ...]
    settings: dict[str, Value]
    tool: Value
    previous: frozenset[Step]
    problem: str | None = None
    literal: Written | None = None
    origin: Step | None = None

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
    """All moves.

    Attributes:
        by_step: moves by where they are written, and by the literals that they take.
        used: literals that serve for something else than targets of moves.
    """

    by_step: dict[Step, Move] = field(default_factory=dict)
    used: set[Key] = field(default_factory=set)

    def note(self, step: Step, move: Move) -> None:
        known = self.by_step.get(step)
        if known is None:
            move.origin = min((each for each in move.previous if each in self.by_step), default=None)
            self.by_step[step] = move
        else:
            known.merge(move)


@dataclass(frozen=True)
class Literal:
    """A move all of whose arguments are plain numbers: slots and signs of each."""

    name: str
    node: Node
    is_pose: tuple[bool, ...]
    targets: tuple[tuple[SlotOf, ...], ...]
    settings: dict[str, SlotOf]


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
    if given is None or any(target not in given for target in signature.targets) or TURNING in given:
        return None
    targets, poses = [], []
    for target in signature.targets:
        slots = slots_of_target(given[target])
        if slots is None:
            return None
        targets.append(slots)
        poses.append(given[target].op == "pose")
    settings = {each: signed_slot(node) for each, node in given.items() if each not in signature.targets}
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


def problem_of(name: str, targets: tuple[Value, ...], tool: Value) -> str | None:
    """Why a move with these targets cannot be resolved, if so."""
    for value in targets:
        if isinstance(value, Unknown):
            return value.why
        if isinstance(value, JointsOf) and isinstance(value.tool, Unknown):
            return value.tool.why
        fits = isinstance(value, JointsOf) or is_joints(value) or (isinstance(value, Pose) and name != "servoj")
        if not fits:
            return _no_target(name, value)
    if isinstance(tool, Unknown) and any(isinstance(value, (Pose, JointsOf)) for value in targets):
        return f"the tool is not known: {tool.why}"
    return None


def _no_target(name: str, value: Value) -> str:
    if isinstance(value, Pose):
        return f"its target is a pose, and {name} takes six joints"
    if isinstance(value, tuple) and all(map(is_number, value)):
        return f"its target is a list of {len(value)} numbers, and six joints are expected"
    return "its target is neither six joints nor a pose"
