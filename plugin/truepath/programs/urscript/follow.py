"""Follows a program along all ways that it can take, without running it, and notes its moves.

Both branches of a condition that nobody knows are followed, and a loop until nothing new is learnt: a value that
comes out differently is not known any more. So a target that is resolved has that value whenever it is reached.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from truepath.errors import InputError
from truepath.programs.urscript.evaluate import built_in, evaluate, with_element, word
from truepath.programs.urscript.moves import (
    LEAD_ELSEWHERE,
    MOVES,
    Key,
    Literal,
    Move,
    Moves,
    literal,
    named,
    problem_of,
)
from truepath.programs.urscript.names import DEFINES, called_anywhere, changed_by_threads
from truepath.programs.urscript.source import Line
from truepath.programs.urscript.state import ANYWHERE, AT_THE_START, State, joined
from truepath.programs.urscript.syntax import Node
from truepath.programs.urscript.tree import Statement
from truepath.programs.urscript.values import JointsOf, Pose, Unknown, Value

DEEPEST_CALLS, MOST_STEPS, MOST_ROUNDS = 30, 3_000_000, 30
ONLY_STATE = (*DEFINES, "assign", "declare")


@dataclass(slots=True, eq=False)
class Frame:
    """A call under way: its scopes from the inside out, and the states in which it was left."""

    scopes: tuple[int, ...]
    functions: dict[str, tuple[Statement, Frame]]
    returned: list[tuple[State, Value]] = field(default_factory=list)
    breaks: list[State] = field(default_factory=list)
    continues: list[State] = field(default_factory=list)


class Follower:
    """Follows one program; its moves are in ``moves`` afterwards.

    Args:
        program: its statements.
        file: for messages.
        tool: in force before the program sets one.
    """

    def __init__(self, program: list[Statement], file: str, tool: Pose) -> None:
        self.moves = Moves()
        self._file = file
        self._state = State(tool)
        self._frame = Frame((0,), {})
        self._muted = self._depth = self._steps = self._scopes = 0
        self._statement: Statement | None = None
        self._volatile = changed_by_threads(program)
        self._run(program)

    def _run(self, program: list[Statement]) -> None:
        self._define(program)
        self._block(program)
        if any(statement.node.op not in ONLY_STATE for statement in program):
            return
        # Nothing is done: the definitions are the programs. Those that others call are not.
        used = called_anywhere(program)
        for statement in program:
            if statement.node.op == "function" and word(statement.node.args[0], statement.line) not in used:
                self._state.last = AT_THE_START
                self._enter(statement, self._frame, [], {})

    # Statements

    def _block(self, statements: list[Statement]) -> bool:
        """Follows statements; False if nothing comes after them."""
        for statement in statements:
            self._steps += 1
            if self._steps > MOST_STEPS:
                raise InputError("the program is too long to be followed", file=self._file)
            if not self._execute(statement):
                return False
        return True

    def _execute(self, statement: Statement) -> bool:
        op = statement.node.op
        if op == "expression":
            plain = literal(statement.shape)
            if plain is not None and plain.name not in self._frame.functions:
                self._note_literal(plain, statement)
            else:
                self._value(statement.node.args[0], statement)
        elif op == "assign":
            self._assign(statement)
        elif op == "if_":
            return self._if(statement)
        elif op == "while_":
            return self._while(statement)
        elif op in ("return_value", "return_nothing"):
            value = self._value(statement.node.args[0], statement) if op == "return_value" else Unknown("no value")
            self._frame.returned.append((self._state.copy(), value))
            return False
        elif op in ("break_", "continue_"):
            (self._frame.breaks if op == "break_" else self._frame.continues).append(self._state.copy())
            return False
        elif op == "declare":
            self._state.values.pop((self._scope_of(statement), self._name(statement.node.args[1], statement)), None)
        return op != "halt"

    def _value(self, node: Node, statement: Statement) -> Value:
        outer, self._statement = self._statement, statement
        value = evaluate(node, statement.line, self)
        self._statement = outer
        return value

    def _assign(self, statement: Statement) -> None:
        scope, target, expression = statement.node.args
        value = self._value(expression, statement)
        path: list[Value] = []
        while target.op in ("index", "member"):
            path = [self._element(node, statement) for node in target.args[1:]] + path
            target = target.args[0]
        if target.op == "pose" and len(target.args[1] or ()) == 1:  # the variable that is called p, with an index
            path = [self._element(target.args[1][0], statement), *path]
            name = "p"
        elif target.op == "name":
            name = word(target, statement.line)
        else:
            raise InputError("nothing can be put there", file=self._file, line=statement.line.number, expected="a name")
        where = self._place(name) if scope is None else (self._scope_of(statement), name)
        if path:
            before = self._state.values.get(where)
            value = with_element(Unknown(f"{name} is not set") if before is None else before, path, value)
        self._state.values[where] = value

    def _element(self, node: Node | str, statement: Statement) -> Value:
        if isinstance(node, str) or node.op == "token":
            return Unknown("members of a struct are not followed")
        return self._value(node, statement)

    def _scope_of(self, statement: Statement) -> int:
        return 0 if statement.node.args[0] == "global" else self._frame.scopes[0]

    def _name(self, node: Node, statement: Statement) -> str:
        return word(node, statement.line) if node.op == "name" else ""

    def _place(self, name: str) -> tuple[int, str]:
        for scope in self._frame.scopes:
            if (scope, name) in self._state.values:
                return scope, name
        return self._frame.scopes[0], name

    def _if(self, statement: Statement) -> bool:
        ends: list[State] = []
        branch: Statement | None = statement
        falls_through = True
        while branch is not None:
            condition = True if branch.node.op == "else_" else self._value(branch.node.args[0], branch)
            if condition is not False:
                before = self._state.copy()
                self._define(branch.body)
                if self._block(branch.body):
                    ends.append(self._state.copy())
                self._state.take(before)
                if condition is True:
                    falls_through = False
                    break
            branch = branch.otherwise
        if falls_through:
            ends.append(self._state.copy())
        if ends:
            self._state.take(joined(ends))
        return bool(ends)

    def _while(self, statement: Statement) -> bool:
        frame = self._frame
        outer = frame.breaks, frame.continues
        entry = self._state.copy()
        runs_at_least_once = False
        self._muted += 1
        for rounds in range(MOST_ROUNDS + 1):
            frame.breaks, frame.continues = [], []
            condition, ends = self._once(statement, entry)
            runs_at_least_once |= rounds == 0 and condition is True
            after = joined([entry, *ends])
            if after == entry:
                break
            entry = after
        else:
            raise InputError("the loop cannot be followed", file=self._file, line=statement.line.number)
        self._muted -= 1
        frame.breaks, frame.continues = [], []
        condition, ends = self._once(statement, entry)
        exits = list(frame.breaks)
        frame.breaks, frame.continues = outer
        if condition is not True:
            exits += ends if runs_at_least_once else [entry, *ends]
        if exits:
            self._state.take(joined(exits))
        return bool(exits)

    def _once(self, statement: Statement, entry: State) -> tuple[Value, list[State]]:
        """The condition, and the states at the end of the body, once round the loop."""
        self._state.take(entry.copy())
        condition = self._value(statement.node.args[0], statement)
        if condition is False:
            return condition, []
        self._define(statement.body)
        ends = [self._state.copy()] if self._block(statement.body) else []
        return condition, ends + self._frame.continues

    # What expressions ask for

    def variable(self, name: str) -> Value:
        if name in self._volatile:
            return Unknown(f"a thread changes {name}")
        return self._state.values.get(self._place(name))

    def call(self, node: Node, arguments: list[Value], keywords: dict[str, Value], line: Line) -> Value:
        name = word(node.args[0], line)
        defined = self._frame.functions.get(name)
        if defined is not None:
            return self._enter(*defined, arguments, keywords)
        if name in MOVES:
            return self._move(node, name, arguments, keywords, line)
        if name == "set_tcp":
            tool = arguments[0] if arguments else keywords.get("pose", Unknown("set_tcp() names no pose"))
            self._state.tool = tool if isinstance(tool, (Pose, Unknown)) else Unknown("set_tcp() is not given a pose")
        if name in LEAD_ELSEWHERE:
            self._state.last = ANYWHERE
        value = built_in(name, arguments, keywords)
        return Unknown(f"{name}() is known to the controller only") if value is None else value

    def start_thread(self, name: str) -> None:
        if name not in self._frame.functions:
            return
        before, moves = self._state.copy(), len(self.moves.by_key)
        self._state.last = ANYWHERE
        self._enter(*self._frame.functions[name], [], {})
        moved = len(self.moves.by_key) > moves
        self._state.take(before)
        if moved:
            self._state.last = ANYWHERE

    def _move(self, node: Node, name: str, arguments: list[Value], keywords: dict[str, Value], line: Line) -> Value:
        signature = MOVES[name]
        given = dict(zip(signature.arguments, arguments, strict=False)) | keywords
        targets = tuple(given.pop(target, Unknown("it names no target")) for target in signature.targets)
        problem = problem_of(name, targets, self._state.tool)
        if named(signature, node) is None:
            problem = problem or f"{name}() has more arguments than it takes"
        assert self._statement is not None
        key = (line.number, node.start)
        tool = self._state.tool
        if len(targets) == 1 and isinstance(targets[0], JointsOf) and targets[0].tool is not None:
            tool = targets[0].tool
        self._note(key, Move(name, node, self._statement, targets, given, tool, self._state.last, problem))
        return Unknown(f"{name}() has no value")

    def _note_literal(self, plain: Literal, statement: Statement) -> None:
        tool = self._state.tool
        problem = f"the tool is not known: {tool.why}" if isinstance(tool, Unknown) and any(plain.is_pose) else None
        key = (statement.line.number, plain.node.start)
        self._note(key, Move(plain.name, plain.node, statement, (), {}, tool, self._state.last, problem))

    def _note(self, key: Key, move: Move) -> None:
        if not self._muted:
            self.moves.note(key, move)
        self._state.last = frozenset({key})

    def _define(self, statements: list[Statement]) -> None:
        for statement in statements:
            if statement.node.op in DEFINES:
                self._frame.functions[word(statement.node.args[0], statement.line)] = (statement, self._frame)

    def _enter(self, function: Statement, home: Frame, arguments: list[Value], keywords: dict[str, Value]) -> Value:
        """Follows a call; its value."""
        name = word(function.node.args[0], function.line)
        if self._depth >= DEEPEST_CALLS:
            raise InputError(
                f"calls of {name}() are too deep to be followed", file=self._file, line=function.line.number
            )
        self._scopes += 1
        frame = Frame((self._scopes, *home.scopes), dict(home.functions))
        taken = function.node.args[1] or () if function.node.op == "function" else ()
        for index, parameter in enumerate(taken):
            default = None
            if parameter.op == "keyword":
                default = self._value(parameter.args[1], function)
            called = word(parameter.args[0] if parameter.op == "keyword" else parameter, function.line)
            missing = Unknown(f"{name}() is called with too little") if default is None else default
            value = arguments[index] if index < len(arguments) else keywords.get(called, missing)
            self._state.values[(self._scopes, called)] = value
        outer, self._frame = self._frame, frame
        self._depth += 1
        self._define(function.body)
        ends = list[tuple[State, Value]]()
        if self._block(function.body):
            ends.append((self._state.copy(), Unknown(f"{name}() returns nothing")))
        ends += frame.returned
        self._depth -= 1
        self._frame = outer
        if not ends:  # it never comes back: whatever follows is not reached, but followed all the same
            return Unknown(f"{name}() does not return")
        state = joined([end for end, _ in ends])
        inside = frame.scopes[0]
        state.values = {key: value for key, value in state.values.items() if key[0] != inside}
        self._state.take(state)
        values = [value for _, value in ends]
        same = all(type(value) is type(values[0]) and value == values[0] for value in values)
        unknown = next((value for value in values if isinstance(value, Unknown)), None)
        return values[0] if same else unknown or Unknown(f"{name}() returns several values")
