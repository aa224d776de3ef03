"""URScript programs made at random whose targets are known by construction.

The writer keeps what each variable holds where it writes: a value, or None where runs differ (a sensor, a counter,
a branch). It writes a target and what it must be read as in the same breath, so nothing is ever parsed here.
"""

import random
from dataclasses import dataclass, field

from generated_expressions import HOME, pose_add, pose_trans
from generated_functions import FunctionWriter
from hypothesis import strategies as st
from spoil import mutate

__all__ = ["HOME", "Generated", "mutated", "pose_add", "pose_trans", "program", "programs"]

DEEPEST = 3  # blocks in blocks
NOISE = (
    "# movel(p[0.1,0.2,0.3,0,0,0], a=1, v=1)",
    "#movej([0,0,0,0,0,0]) end",
    '# ümlaut → № 5 "unbalanced ( [ {',
    'popup("movel(p[0.1,0.2,0.3,0,0,0])", title="set_tcp(p[0,0,1,0,0,0])", blocking=False)',
    'textmsg("def x(): # end")',
    "set_digital_out(3, True)",
    "set_standard_analog_out(0, 0.5)",
    "sleep(0.1)",
    "sync()",
    "set_payload(1.2, [0.0, 0.0, 0.05])",
    'socket_send_string("movej([0,0,0,0,0,0])", "pc")',
    "stopl(1.0)",
    "",
    "  \t",
)


@dataclass(frozen=True)
class Generated:
    """A program and what is known of it.

    Attributes:
        text: the program, with its own line ends and perhaps a byte-order mark; ``data`` is the same in bytes.
        targets: in file order; ``line``, ``kind``, ``pose`` or ``joints``, ``near``, ``tool``, ``speed``,
            ``acceleration``, ``time_s``, ``blend_m``, ``moved_by`` as in the corpus.
        unresolved_lines: lines of targets that runs of the program do not agree on.
        not_run_lines: lines of targets in functions that nobody calls.
    """

    text: str
    targets: list = field(default_factory=list)
    unresolved_lines: list = field(default_factory=list)
    not_run_lines: list = field(default_factory=list)

    @property
    def data(self) -> bytes:
        return self.text.encode()


class _ProgramWriter(FunctionWriter):
    """Writes statements until the budget is spent."""

    def statement(self):
        self.budget -= 1
        rng, deep = self.rng, self.level
        most = self.deepest + 1
        choices = ["move"] * 8 + ["noise"] * 3 + ["create"] * 3 + ["change"] * 2
        if deep < most and self.budget > 0:
            choices += ["branch"] * 2 + ["sensed"] + ["counted"]
        if not self.in_function:
            callable_here = [f for f in self.functions if deep <= 1 or f.tool == self.tool]
            choices += ["call"] * 2 if callable_here else []
            choices += ["tool"] * 2 + ["doubtful"] if deep <= 1 else []
        match rng.choice(choices):
            case "move":
                self.move()
            case "noise":
                self.put(rng.choice(NOISE))
                self.put("sync()")  # no block of comments only
            case "create":
                self.create()
            case "change":
                self.change()
            case "branch":
                self.branch()
            case "sensed":
                self.sensed_loop()
            case "counted":
                self.counted_loop()
            case "call":
                self.call(rng.choice(callable_here))
            case "tool":
                self.set_tool()
            case "doubtful":
                self.doubtful_tool()

    def program(self):
        rng = self.rng
        self.level = 0 if self.framed else 1
        for _ in range(rng.randint(0, 2)):
            self.put(rng.choice(NOISE[:3]))
        if self.framed:
            self.put("def program():")
        self.level = 1
        for _ in range(rng.randint(0, 3)):
            self.create()
        self.constants, self.assignable = dict(self.values), set()
        for make in (self.lift, self.tool_function, self.thread):
            if rng.random() < 0.4:
                make()
        for _ in range(rng.randint(0, 3)):
            self.function()
        if rng.random() < 0.4:
            self.wrapper()
        self.set_tool()
        while self.budget > 0:
            self.statement()
        for function in self.functions:
            for _ in range(max(0, (2 if function.varied else 1) - function.calls)):
                self.call(function)
        if self.framed:
            self.level = 0
            self.put("end")
            if rng.random() < 0.4:
                self.put("program()")
        end = rng.choice(("\n", "\n", "\r\n"))
        text = rng.choice(("", "", "", "\ufeff")) + end.join(self.lines) + rng.choice((end, end, ""))
        targets = sorted(self.targets, key=lambda t: t["line"])  # stable: a THROUGH stays before its ARC
        return Generated(text, targets, sorted(self.unresolved), sorted(self.not_run))


def program(seed, statements=25, depth=DEEPEST):
    """One program; the same seed makes the same one."""
    return _ProgramWriter(random.Random(seed), statements, depth).program()


def programs(most_statements=40):
    """Hypothesis strategy of ``Generated``."""
    return st.builds(
        program,
        st.integers(0, 2**32 - 1),
        statements=st.integers(1, most_statements),
        depth=st.integers(0, DEEPEST),
    )


def mutated(most_statements=25):
    """Hypothesis strategy of spoilt programs in bytes."""
    return st.builds(
        lambda made, seed: mutate(made.text, random.Random(seed)), programs(most_statements), st.integers(0, 2**32 - 1)
    )
