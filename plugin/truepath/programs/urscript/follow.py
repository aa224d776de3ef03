"""Follows a program along all ways that it can take, without running it, and notes its moves.

Both branches of a condition that nobody knows are followed, and a loop until nothing new is learnt: a value that
comes out differently is not known any more. So a target that is resolved has that value whenever it is reached.
"""

from __future__ import annotations

from truepath.errors import InputError
from truepath.programs.urscript.evaluate import handed_on, with_element, word
from truepath.programs.urscript.moves import literal
from truepath.programs.urscript.names import (
    DEFINES,
    assigned,
    called_anywhere,
)
from truepath.programs.urscript.noted import move_of_literal
from truepath.programs.urscript.scene import CHARACTERS_PER_STEP, Scene
from truepath.programs.urscript.state import AT_THE_START, State
from truepath.programs.urscript.syntax import Node
from truepath.programs.urscript.tree import Statement
from truepath.programs.urscript.values import Pose, Unknown, Value

MOST_ROUNDS = 30


class Follower(Scene):
    """Follows one program; its moves are in ``moves`` afterwards.

    Args:
        program: its statements.
        file: for messages.
        tool: in force before the program sets one.
    """

    def __init__(self, program: list[Statement], file: str, tool: Pose) -> None:
        super().__init__(program, file, tool)
        self._run(program)

    def _run(self, program: list[Statement]) -> None:
        self._define(program)
        self._block(program)
        calls = {word(call, each.line) for each in program if each.node.op not in DEFINES for call in each.shape.calls}
        if self.moves.by_step or calls & self._frame.functions.keys():
            return
        # Nothing is moved, nothing called: the definitions are the programs. Those that others call are not.
        used = called_anywhere(program)
        for statement in program:
            if statement.node.op == "function" and word(statement.node.args[0], statement.line) not in used:
                self._state.last = AT_THE_START
                self._enter(statement, self._frame, [], {})

    # Statements

    def _block(self, statements: list[Statement]) -> bool:
        """Follows statements; False if nothing comes after them."""
        for statement in statements:
            self._goes_on(1 + len(statement.line.code) // CHARACTERS_PER_STEP, statement)
            if not self._execute(statement):
                return False
        return True

    def _execute(self, statement: Statement) -> bool:
        op = statement.node.op
        if op == "expression":
            known = literal(statement.shape)
            if known is not None and self._frame.function(known.name) is None:
                self._note(*move_of_literal(known, statement, self._state.tool, self._state.last))
            else:
                self._value(statement.node.args[0], statement)
        elif op == "assign":
            self._assign(statement)
        elif op == "if_":
            return self._if(statement)
        elif op == "while_":
            return self._while(statement)
        elif op in ("return_value", "return_nothing"):
            value = (
                self._value(statement.node.args[0], statement, handed_on)
                if op == "return_value"
                else Unknown("no value")
            )
            self._frame.returned.append((self._kept(), value))
            return False
        elif op in ("break_", "continue_"):
            (self._frame.breaks if op == "break_" else self._frame.continues).append(self._kept())
            return False
        elif op == "declare":
            self._state.values.pop((self._scope_of(statement), self._name(statement.node.args[1], statement)), None)
        return op != "halt"

    def _assign(self, statement: Statement) -> None:
        scope, target, expression = statement.node.args
        value = self._value(expression, statement, handed_on)
        name = assigned(statement)
        if not name:
            raise InputError("nothing can be put there", file=self._file, line=statement.line.number, expected="a name")
        path: list[Value] = []
        while target.op in ("index", "member"):
            path = [self._element(node, statement) for node in target.args[1:]] + path
            target = target.args[0]
        if target.op == "pose":
            path = [self._element(target.args[1][0], statement), *path]
        where = self._place(name) if scope is None else (self._scope_of(statement), name)
        if path:
            before = self.used(self._state.values.get(where))
            value = with_element(Unknown(f"{name} is not set") if before is None else before, path, self.used(value))
        self._state.values[where] = self.used(value) if name in self._volatile else value

    def _element(self, node: Node | str, statement: Statement) -> Value:
        if isinstance(node, str) or node.op == "token":
            return Unknown("members of a struct are not followed")
        return self._value(node, statement)

    def _scope_of(self, statement: Statement) -> int:
        return 0 if statement.node.args[0] == "global" else self._frame.scopes[0]

    def _name(self, node: Node, statement: Statement) -> str:
        return word(node, statement.line) if node.op == "name" else ""

    def _if(self, statement: Statement) -> bool:
        ends: list[State] = []
        branch: Statement | None = statement
        falls_through = True
        while branch is not None:
            condition = True if branch.node.op == "else_" else self._value(branch.node.args[0], branch)
            if condition is not False:
                before = self._kept()
                self._define(branch.body)
                if self._block(branch.body):
                    ends.append(self._kept())
                self._state.take(before)
                if condition is True:
                    falls_through = False
                    break
            branch = branch.otherwise
        if falls_through:
            ends.append(self._kept())
        if ends:
            self._state.take(self._joined(ends))
        return bool(ends)

    def _while(self, statement: Statement) -> bool:
        frame = self._frame
        outer = frame.breaks, frame.continues
        entry = self._kept()
        runs_at_least_once = False
        self._muted += 1
        for rounds in range(MOST_ROUNDS + 1):
            frame.breaks, frame.continues = [], []
            condition, ends = self._once(statement, entry)
            runs_at_least_once |= rounds == 0 and condition is True
            after = self._joined([entry, *ends])
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
            self._state.take(self._joined(exits))
        return bool(exits)

    def _once(self, statement: Statement, entry: State) -> tuple[Value, list[State]]:
        """The condition, and the states at the end of the body, once round the loop."""
        self._state.take(entry.copy())
        condition = self._value(statement.node.args[0], statement)
        if condition is False:
            return condition, []
        self._define(statement.body)
        ends = [self._kept()] if self._block(statement.body) else []
        return condition, ends + self._frame.continues
