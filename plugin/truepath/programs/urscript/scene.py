"""What expressions ask of a program: its variables, its functions, its moves. See ``follow.py`` for its statements."""

from __future__ import annotations

from collections.abc import Callable

from truepath.errors import InputError
from truepath.programs.urscript.evaluate import built_in, evaluate, handed_on, word
from truepath.programs.urscript.moves import (
    LEAD_ASIDE,
    LEAD_ELSEWHERE,
    MOVES,
    NOT_CORRECTED,
    SET_TOOL,
    Move,
    Moves,
    Step,
)
from truepath.programs.urscript.names import (
    DEFINES,
    all_statements,
    called_by_threads,
    changed_by_threads,
    own_names,
    parameters,
)
from truepath.programs.urscript.noted import move_of
from truepath.programs.urscript.source import Line
from truepath.programs.urscript.state import ANYWHERE, Frame, State, joined
from truepath.programs.urscript.syntax import Node
from truepath.programs.urscript.tree import Statement
from truepath.programs.urscript.values import PURE, Pose, Unknown, Value
from truepath.programs.urscript.written import Written

DEEPEST_CALLS = 30
# A step is some five millionths of a second. Long programs may take more of them than short ones that go in circles.
STEPS, STEPS_PER_STATEMENT = 200_000, 10
STEPS_OF_ALGEBRA, VALUES_PER_STEP, CHARACTERS_PER_STEP = 40, 150, 64


class Scene:
    """A program while it is followed; its moves are in ``moves`` afterwards."""

    def __init__(self, program: list[Statement], file: str, tool: Pose) -> None:
        self.moves = Moves()
        self._file = file
        self._state = State(tool)
        self._frame = Frame((0,), None)
        self._muted = self._depth = self._scopes = 0
        self._steps = max(STEPS, STEPS_PER_STATEMENT * len(all_statements(program)))
        self._own_names: dict[Statement, set[str]] = {}
        self._statement: Statement | None = None
        self._tool_of_threads: Unknown | None = None
        self._volatile = changed_by_threads(program)
        if SET_TOOL in called_by_threads(program):
            self._state.tool = self._tool_of_threads = Unknown("a thread calls set_tcp()")

    def _block(self, statements: list[Statement]) -> bool:
        """Follows statements; False if nothing comes after them."""
        raise NotImplementedError

    def _value(self, node: Node, statement: Statement, how: Callable[..., Value] = evaluate) -> Value:
        outer, self._statement = self._statement, statement
        value = how(node, statement.line, self)
        self._statement = outer
        return value

    def _place(self, name: str) -> tuple[int, str]:
        for scope in self._frame.scopes:
            if (scope, name) in self._state.values:
                return scope, name
        return self._frame.scopes[0], name

    def _goes_on(self, steps: int, statement: Statement | None = None) -> None:
        self._steps -= steps
        if self._steps < 0:
            raise InputError(
                "the program takes too long to be followed: too many ways through its loops, conditions and calls",
                file=self._file,
                line=statement.line.number if statement is not None else None,
            )

    def _kept(self) -> State:
        """The state as it is, for later."""
        self._goes_on(len(self._state.values) // VALUES_PER_STEP, self._statement)
        return self._state.copy()

    def _joined(self, states: list[State]) -> State:
        self._goes_on(sum(2 + len(state.values) // VALUES_PER_STEP for state in states), self._statement)
        return joined(states, self.moves.used)

    def takes_literals(self, name: str) -> bool:
        """Whether a call can hand a literal on: to a function of the program, or as the target of a move."""
        return name in MOVES or self._frame.function(name) is not None

    def written(self, value: Value, node: Node, line: Line) -> Written:
        assert self._statement is not None
        return Written(value, line, self._statement.shape, node)

    def used(self, value: Value | Written) -> Value:
        """The value alone, for who does something else with it than hand it on."""
        if isinstance(value, Unknown):
            self.moves.used |= value.literals
        if not isinstance(value, Written):
            return value
        self.moves.used.add(value.key)
        return value.value

    def variable(self, name: str) -> Value | Written:
        if name in self._volatile:
            return Unknown(f"a thread changes {name}")
        value = self._state.values.get(self._place(name))
        return self.used(value) if isinstance(value, Unknown) else value

    def call(self, node: Node, arguments: list[Value], keywords: dict[str, Value], line: Line) -> Value | Written:
        name = word(node.args[0], line)
        defined = self._frame.function(name)
        if defined is not None:
            return self._enter(*defined, arguments, keywords)
        if name in MOVES:
            return self._move(node, name, arguments, keywords, line)
        if name == SET_TOOL:
            tool = arguments[0] if arguments else keywords.get("pose", Unknown("set_tcp() names no pose"))
            known = tool if isinstance(tool, (Pose, Unknown)) else Unknown("set_tcp() is not given a pose")
            self._state.tool = self._tool_of_threads or known
        if name in NOT_CORRECTED:
            assert self._statement is not None
            why = f"{name}() is not corrected"
            move = Move(name, node, self._statement, (), {}, self._state.tool, self._state.last, why)
            self._note((line.number, node.start), move)
        if name in LEAD_ELSEWHERE:
            self._state.last = ANYWHERE
        if name in LEAD_ASIDE:
            self._state.last |= ANYWHERE
        if name in PURE:
            self._goes_on(STEPS_OF_ALGEBRA, self._statement)
        value = built_in(name, arguments, keywords)
        return Unknown(f"{name}() is known to the controller only") if value is None else value

    def forget(self, name: str, why: str) -> None:
        """The value of a variable is not known any more."""
        place = self._place(name)
        if place in self._state.values:
            self.used(self._state.values[place])
            self._state.values[place] = Unknown(why)

    def perhaps(self, node: Node, line: Line) -> Value:
        """The value of an expression that may be left out; what it does is done or not."""
        assert self._statement is not None
        if not self._statement.shape.calls:
            return evaluate(node, line, self)
        before = self._kept()
        value = evaluate(node, line, self)
        self._state = self._joined([before, self._state])
        return value

    def start_thread(self, name: str) -> None:
        defined = self._frame.function(name)
        if defined is None:
            return
        before, moves = self._kept(), len(self.moves.by_step)
        self._state.last = ANYWHERE
        self._enter(*defined, [], {})
        moved = len(self.moves.by_step) > moves
        self._state.take(before)
        if moved:
            self._state.last = ANYWHERE

    def _move(self, node: Node, name: str, arguments: list[Value], keywords: dict[str, Value], line: Line) -> Value:
        assert self._statement is not None
        state = self._state
        self._note(*move_of(name, node, self._statement, arguments, keywords, state.tool, state.last, self.used))
        return Unknown(f"{name}() has no value")

    def _note(self, step: Step, move: Move) -> None:
        if not self._muted:
            self.moves.note(step, move)
        self._state.last = frozenset({step})

    def _define(self, statements: list[Statement]) -> None:
        for statement in statements:
            if statement.node.op in DEFINES:
                self._frame.functions[word(statement.node.args[0], statement.line)] = (statement, self._frame)

    def _enter(
        self, function: Statement, home: Frame, arguments: list[Value], keywords: dict[str, Value]
    ) -> Value | Written:
        """Follows a call; its value."""
        name = word(function.node.args[0], function.line)
        if self._depth >= DEEPEST_CALLS:
            raise InputError(
                f"calls of {name}() are too deep to be followed", file=self._file, line=function.line.number
            )
        self._scopes += 1
        frame = Frame((self._scopes, *home.scopes), home)
        for index, parameter in enumerate(parameters(function)):
            default = None
            if parameter.op == "keyword":
                default = self._value(parameter.args[1], function, handed_on)
            called = word(parameter.args[0] if parameter.op == "keyword" else parameter, function.line)
            missing = Unknown(f"{name}() is called with too little") if default is None else default
            value = arguments[index] if index < len(arguments) else keywords.get(called, missing)
            self._state.values[(self._scopes, called)] = self.used(value) if called in self._volatile else value
        outer, self._frame = self._frame, frame
        self._depth += 1
        self._define(function.body)
        ends = list[tuple[State, Value | Written]]()
        if self._block(function.body):
            ends.append((self._state, Unknown(f"{name}() returns nothing")))
        ends += frame.returned
        self._depth -= 1
        self._frame = outer
        if not ends:  # it never comes back: whatever follows is not reached, but followed all the same
            return Unknown(f"{name}() does not return")
        state = ends[0][0] if len(ends) == 1 else self._joined([end for end, _ in ends])
        if function not in self._own_names:
            self._own_names[function] = own_names(function)
        for own in self._own_names[function]:
            state.values.pop((frame.scopes[0], own), None)
        self._state = state
        values = [value for _, value in ends]
        if any(value != values[0] for value in values):
            values = [self.used(value) for value in values]
        same = all(type(value) is type(values[0]) and value == values[0] for value in values)
        unknown = next((value for value in values if isinstance(value, Unknown)), None)
        return values[0] if same else unknown or Unknown(f"{name}() returns several values")
