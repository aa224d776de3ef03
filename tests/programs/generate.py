"""URScript programs made at random whose targets are known by construction.

The writer keeps what each variable holds where it writes: a value, or None where runs differ (a sensor, a counter,
a branch). It writes a target and what it must be read as in the same breath, so nothing is ever parsed here.
"""

import random
from dataclasses import dataclass, field

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from spoil import mutate

DOWN = Rotation.from_rotvec([np.pi, 0.0, 0.0])
HOME = (0.0, -1.2, 1.8, -2.2, -1.57, 0.0)
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
CONDITIONS = (
    "get_digital_in(1)",
    "(get_standard_digital_in(2) == True)",
    "not get_digital_in(3)",
    "(read_input_float_register(1) > 0.5)",
    "get_digital_in(1) and (read_input_integer_register(0) < 3)",
    "(get_digital_in(4) or get_digital_in(5))",
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


@dataclass
class _Function:
    name: str
    tool: list
    parameter: tuple | None  # text and value that a call must pass; None for a function without parameters
    varied: bool = False  # called with different targets
    calls: int = 0
    moved_by: dict | None = None  # of one that is nothing but a move to its target: what each target is besides


def _matrix(pose):
    X = np.eye(4)
    X[:3, :3] = Rotation.from_rotvec(pose[3:]).as_matrix()
    X[:3, 3] = pose[:3]
    return X


def pose_trans(a, b):
    """``[6]``; None where one of them is."""
    if a is None or b is None:
        return None
    X = _matrix(a) @ _matrix(b)
    return [*X[:3, 3].tolist(), *Rotation.from_matrix(X[:3, :3]).as_rotvec().tolist()]


def pose_add(a, b):
    """``[6]``; None where one of them is."""
    if a is None or b is None:
        return None
    turn = Rotation.from_rotvec(a[3:]) * Rotation.from_rotvec(b[3:])
    return [*np.add(a[:3], b[:3]).tolist(), *turn.as_rotvec().tolist()]


class _Writer:
    def __init__(self, rng, statements, depth):
        self.rng, self.budget, self.deepest = rng, statements, depth
        self.indent = rng.choice(("  ", "    ", "\t", " "))
        self.comma = rng.choice((", ", ",", " , ", ",  "))
        self.equals = rng.choice((" = ", "=", "  =\t", " := "))
        self.lines, self.targets, self.unresolved, self.not_run = [], [], [], []
        self.values, self.kinds = {}, {}  # what variables hold here, and whether that is a number, pose, joints or list
        self.assignable = set()  # those that may be assigned again here without anyone else noticing
        self.tool = [0.0] * 6
        self.functions, self.lifts, self.tool_functions = [], [], []
        self.constants = {}  # assigned once, at the start: what functions see
        self.level, self.in_function, self.is_run, self.count = 1, False, True, 0
        self.framed = rng.random() < 0.85  # by a function that is the program

    # --- text

    def put(self, text):
        blank = self.rng.choice(("", "", "", "", " ", "\t", "  # " + self.rng.choice(("ok", "end", "p[0,0"))))
        indent = self.indent * (self.level - (not self.framed))
        self.lines.append(indent + text + blank if text.strip() else text)
        return len(self.lines)

    def fresh(self, stem):
        self.count += 1
        return f"{stem}_{self.count}"

    def pick(self, kind, known=False):
        names = [n for n, k in self.kinds.items() if k == kind and n in self.values]
        names = [n for n in names if not known or self.values[n] is not None]
        return self.rng.choice(names) if names else None

    # --- expressions: their text and their value

    def number(self, low, high, decimals=5):
        """A number somewhere between, in one of many spellings."""
        rng, value = self.rng, round(self.rng.uniform(low, high), decimals)
        plain = f"{value:.{decimals}f}"
        match rng.randrange(8):
            case 0:
                part = round(rng.uniform(0, 0.1), 3)
                rest = f"{value - part:.{decimals}f}"
                return f"{rest}+{part}", float(rest) + part
            case 1:
                return f"{2 * value:.{decimals}f}/2", float(f"{2 * value:.{decimals}f}") / 2
            case 2:
                text = f"{value:.6e}"
                return text, float(text)
            case 3:
                text = f"{-value:.{decimals}f}"
                return (f"-({text})", -float(text))
            case 4 if (name := self.pick("number", known=True)) and rng.random() < 0.5:
                rest = f"{value - self.values[name]:.{decimals}f}"
                return f"{name} + {rest}", self.values[name] + float(rest)
        return plain, float(plain)

    def listed(self, parts, prefix=""):
        values = [value for _, value in parts]
        return f"{prefix}[{self.comma.join(t for t, _ in parts)}]", (None if None in values else values)

    def literal_pose(self):
        rng = self.rng
        turn = (Rotation.from_rotvec([0, 0, rng.uniform(-0.8, 0.8)]) * DOWN).as_rotvec()
        place = [self.number(-0.5, -0.38), self.number(-0.25, 0.05), self.number(0.18, 0.32)]
        return self.listed(place + [(f"{v:.6f}", float(f"{v:.6f}")) for v in turn], "p")

    def offset(self, with_counter=True):
        """A small pose; one in a few depends on something that only a run knows."""
        parts = [self.number(-0.02, 0.02) for _ in range(3)] + [("0", 0.0), ("0.0", 0.0), self.number(-0.1, 0.1, 4)]
        name = self.pick("number") if with_counter and self.rng.random() < 0.5 else None
        if name is not None:
            value = self.values[name]
            parts[self.rng.randrange(3)] = (f"0.001*{name}", None if value is None else 0.001 * value)
        return self.listed(parts, "p")

    def pose(self, deep=0):
        rng, name = self.rng, self.pick("pose")
        choice = rng.randrange(9)
        if choice <= 2 and name:
            return name, self.values[name]
        if choice in (3, 4) and deep < 2:
            (a, A), (b, B) = self.pose(deep + 1), self.offset()
            return (
                (f"pose_trans({a}{self.comma}{b})", pose_trans(A, B))
                if choice == 3
                else (f"pose_add({a}{self.comma}{b})", pose_add(A, B))
            )
        if choice == 5 and self.lifts and deep < 2:
            (a, A), height = self.pose(deep + 1), round(rng.uniform(0.01, 0.03), 3)
            return f"{rng.choice(self.lifts)}({a}, {height})", pose_add(A, [0, 0, height, 0, 0, 0])
        if choice == 6 and (array := self.pick("poses")):
            index, poses = self.pick("counter"), self.values[array]
            if index and rng.random() < 0.6:
                return f"{array}[{index}]", None
            k = rng.randrange(len(poses))
            return f"{array}[{k}]", poses[k]
        return self.literal_pose()

    def literal_joints(self):
        parts = []
        for middle in HOME:
            value = middle + self.rng.uniform(-0.3, 0.3)
            if self.rng.random() < 0.2:
                degrees = f"{np.degrees(value):.3f}"
                parts.append((f"d2r({degrees})", float(np.radians(float(degrees)))))
            else:
                parts.append(self.number(value - 0.01, value + 0.01))
        return self.listed(parts)

    def joints(self):
        name = self.pick("joints")
        return (name, self.values[name]) if name and self.rng.random() < 0.4 else self.literal_joints()

    # --- moves

    def move(self):
        rng = self.rng
        kind = rng.choice(("movej", "movej", "movel", "movel", "movel", "movep", "movec", "servoj"))
        where = []  # text, value, the key that it is recorded under, near
        if kind == "servoj" or (kind == "movej" and rng.random() < 0.6) or rng.random() < 0.1:
            text, value = self.joints()
            where.append((text, value, "joints", None))
        else:
            text, value = self.pose()
            near = None
            if kind == "movej" and rng.random() < 0.6:
                near_text, near = self.literal_joints()
                text = f"get_inverse_kin({text}{self.comma}{rng.choice(('', 'qnear='))}{near_text})"
            where.append((text, value, "pose", near))
        if kind == "movec":
            text, value = self.literal_pose()
            where.insert(0, (text, value, "pose", None))
            if where[1][1] is None:  # half a movec that is known would be a matter of taste
                kind = "movel"
                del where[0]
        arguments, stated = self.settings(kind)
        line = self.put(f"{kind}({self.comma.join([*(text for text, *_ in where), *arguments])})")
        if not self.is_run:
            self.not_run.append(line)
        elif where[-1][1] is None:
            self.unresolved.append(line)
        else:
            names = {"movej": "joint", "movel": "linear", "movep": "process", "movec": "arc", "servoj": "servo"}
            for number, (_, value, key, near) in enumerate(where, start=1):
                through = number < len(where)
                target = {"line": line, "kind": "through" if through else names[kind], key: value}
                target |= {"near": near} if near is not None else {}
                blend = () if through else ("blend_m",)
                kept = {k: v for k, v in stated.items() if k in ("speed", "acceleration", "time_s", *blend)}
                self.targets.append(target | {"tool": list(self.tool)} | kept)

    def settings(self, kind):
        """Arguments after the targets, positional, by name or none, and what they state."""
        rng = self.rng
        a, v, r = round(rng.uniform(0.2, 1.4), 3), round(rng.uniform(0.01, 1.0), 4), round(rng.uniform(0, 0.004), 4)
        if kind == "servoj":
            return rng.choice((["t=0.008", "gain=300"], ["0", "0", "0.008", "0.1", "300"])), {"time_s": 0.008}
        if rng.random() < 0.1:
            return [], {}
        stated = {"acceleration": a, "speed": v}
        if rng.random() < 0.4:
            arguments = [f"{a}", f"{v}"]
            if rng.random() < 0.6:
                arguments += [f"{r}"] if kind in ("movep", "movec") else ["0", f"{r}"]
                stated["blend_m"] = r
            return arguments, stated
        if kind in ("movej", "movel") and rng.random() < 0.2:
            return [f"t={v}", f"r={r}"], {"time_s": v, "blend_m": r}
        arguments = [f"a={a}", f"v = {v}", f"r={r}"]
        rng.shuffle(arguments)
        return arguments, stated | {"blend_m": r}

    # --- statements

    def create(self):
        rng, stem = self.rng, self.rng.choice(("number", "pose", "pose", "joints", "poses"))
        name = self.fresh({"number": "x", "pose": "p", "joints": "q", "poses": "list"}[stem])
        if stem == "number":
            text, value = self.number(-0.02, 0.02, 3)
            if rng.random() < 0.15:
                text, value = "read_input_float_register(2)", None
        elif stem == "poses":
            text, value = self.listed([self.literal_pose() for _ in range(4)])
        else:
            text, value = self.pose() if stem == "pose" else self.literal_joints()
            if stem == "pose" and rng.random() < 0.12:
                text, value = "get_actual_tcp_pose()", None
        scope = rng.choice(("", "", "local " if self.in_function else "global "))
        self.put(f"{scope}{name}{self.equals}{text}")
        self.values[name], self.kinds[name] = value, stem
        if stem == "pose":
            self.assignable.add(name)

    def change(self):
        names = sorted(self.assignable & self.values.keys())
        if not names:
            return self.create()
        name = self.rng.choice(names)
        if self.values[name] is not None and self.rng.random() < 0.4:
            self.put(f"{name}[2]{self.equals}{name}[2] + 0.005")
            self.values[name] = [v + 0.005 if i == 2 else v for i, v in enumerate(self.values[name])]
        else:
            text, self.values[name] = self.literal_pose()
            self.put(f"{name}{self.equals}{text}")
        return None

    def block(self, length):
        self.level += 1
        for _ in range(length):
            self.statement()
        self.level -= 1

    def branch(self):
        before, ends = dict(self.values), []
        count = self.rng.randint(1, 3)
        closed = self.rng.random() < 0.5
        for k in range(count + closed):
            condition = self.rng.choice(CONDITIONS)
            head = "else:" if k == count else f"{'elif' if k else 'if'} {condition}:"
            self.put(head)
            self.values = dict(before)
            self.block(self.rng.randint(1, 3))
            ends.append(self.values)
        if not closed:
            ends.append(before)
        self.put("end")
        self.values = {n: ends[0][n] if all(e[n] == ends[0][n] for e in ends) else None for n in before}

    def sensed_loop(self):
        """Runs a number of times that nobody knows; some poses change in it from one turn to the next."""
        rng, outer = self.rng, self.assignable
        changing = sorted(outer & self.values.keys())
        changing = rng.sample(changing, min(len(changing), rng.randint(0, 2)))
        self.values |= dict.fromkeys(changing)
        before = dict(self.values)
        self.assignable = set(changing)
        self.put(f"while {rng.choice(CONDITIONS)}:")
        self.block(rng.randint(1, 4))
        self.level += 1
        if rng.random() < 0.3:
            self.put("if get_digital_in(6):")
            self.put(self.indent + "break")
            self.put("end")
        for name in changing:
            self.put(f"{name}{self.equals}{self.literal_pose()[0]}")
        self.level -= 1
        self.put("end")
        self.values, self.assignable = before, outer

    def counted_loop(self):
        counter, outer, before = self.fresh("i"), self.assignable, dict(self.values)
        self.assignable = set()
        self.put(f"{counter}{self.equals}0")
        self.put(f"while {counter} < 4:")
        self.values[counter], self.kinds[counter] = None, "counter"
        self.values[f"{counter}*1.0"], self.kinds[f"{counter}*1.0"] = None, "number"
        self.block(self.rng.randint(1, 3))
        self.level += 1
        self.put(f"{counter}{self.equals}{counter} + 1")
        self.level -= 1
        self.put("end")
        self.values, self.assignable = before, outer

    def set_tool(self):
        if self.tool_functions and self.rng.random() < 0.3:
            name, tool = self.rng.choice(self.tool_functions)
            self.put(f"{name}()")
        else:
            tool = self.new_tool()
            self.put(f"set_tcp({self.tool_text(tool)})")
        self.tool = tool

    def new_tool(self):
        return [0.0, 0.0, round(self.rng.uniform(0.02, 0.15), 4), 0.0, 0.0, round(self.rng.uniform(-1, 1), 3)]

    def tool_text(self, tool):
        return f"p[{self.comma.join(str(v) for v in tool)}]"

    def doubtful_tool(self):
        """A tool that is set or not, a pose that nobody can place therefore, and certainty again."""
        self.put(f"if {self.rng.choice(CONDITIONS)}:")
        self.put(f"{self.indent}set_tcp({self.tool_text(self.new_tool())})")
        self.put("end")
        self.unresolved.append(self.put(f"movel({self.literal_pose()[0]}, a=1, v=0.1)"))
        self.set_tool()

    def call(self, function, parameter=None):
        if function.tool != self.tool:
            self.put(f"set_tcp({self.tool_text(function.tool)})")
            self.tool = list(function.tool)
        if function.moved_by is not None:
            self.targets.append(self.wrapped(function))
        elif function.varied:
            self.put(f"{function.name}({self.literal_pose()[0]})")
        else:
            self.put(f"{function.name}({'' if function.parameter is None else function.parameter[0]})")
        function.calls += 1

    def wrapped(self, function):
        """A call with a literal, or with a variable that holds one: the target is where the literal is."""
        (text, pose), name = self.literal_pose(), None
        if self.rng.random() < 0.3:
            name = self.fresh("w")
            line = self.put(f"{name}{self.equals}{text}")
        called = self.put(f"{function.name}({name or text})")
        return {"line": line if name else called, "pose": pose, "tool": list(function.tool), **function.moved_by}

    def wrapper(self):
        """Defines a function that moves to whatever target it is given, and does nothing else with it."""
        rng, function = self.rng, _Function(self.fresh("weld"), self.new_tool(), None, varied=True)
        target = self.fresh("seam")
        kind, name = rng.choice((("linear", "movel"), ("process", "movep"), ("joint", "movej")))
        stated = {"acceleration": round(rng.uniform(0.2, 1.4), 3), "speed": round(rng.uniform(0.01, 1.0), 4)}
        self.put(f"def {function.name}({target}):")
        self.put(f"{self.indent}set_digital_out(2, True)")
        goal = target
        if rng.random() < 0.3:
            goal = self.fresh("goal")
            self.put(f"{self.indent}local {goal}{self.equals}{target}")
        settings = f"a={stated['acceleration']}{self.comma}v={stated['speed']}"
        line = self.put(f"{self.indent}{name}({goal}{self.comma}{settings})")
        self.put("end")
        function.moved_by = {"kind": kind, "moved_by": line, **stated}
        self.functions.append(function)

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

    # --- functions

    def function(self, nested=False):
        """Defines one: called once or often, with one target or several, or never."""
        rng, outer = self.rng, (self.values, self.assignable, self.tool, self.in_function, self.is_run)
        way = rng.choice(("plain", "same", "varied", "never"))
        function = _Function(self.fresh("go"), self.new_tool(), None)
        self.tool, self.in_function = list(function.tool), True
        self.values, self.assignable = dict(self.constants), set()
        if nested:
            way, function.tool, self.tool = "plain", outer[2], outer[2]
        self.is_run = self.is_run and way != "never"
        target = self.fresh("target")
        if way in ("same", "varied"):
            function.parameter, function.varied = self.literal_pose(), way == "varied"
            self.values[target] = None if function.varied else function.parameter[1]
            self.kinds[target] = "pose"
        self.put(f"def {function.name}({target if function.parameter else ''}):")
        if function.varied:  # whoever looks into its target means it as it is: no literal may be changed
            self.put(f"{self.indent}{self.fresh('z')}{self.equals}{target}[2]")
        inner = None
        if not nested and rng.random() < 0.4:
            self.level += 1
            inner = self.function(nested=True)
            self.level -= 1
        self.block(rng.randint(1, 4))
        self.level += 1
        if inner:
            self.put(f"{inner.name}()")
        self.move()
        self.level -= 1
        self.put("end")
        self.values, self.assignable, self.tool, self.in_function, self.is_run = outer
        if not nested and way != "never":
            self.functions.append(function)
        return function

    def lift(self):
        name = self.fresh("lift")
        self.put(f"def {name}(where{self.comma}height):")
        self.put(f"{self.indent}return pose_add(where, p[0, 0, height, 0, 0, 0])")
        self.put("end")
        self.lifts.append(name)

    def tool_function(self):
        name, tool = self.fresh("use_tool"), self.new_tool()
        self.put(f"def {name}():")
        self.put(f"{self.indent}set_tcp({self.tool_text(tool)})")
        self.put("end")
        self.tool_functions.append((name, tool))

    def thread(self):
        name = self.fresh("watch")
        self.put(f"thread {name}():")
        self.put(f"{self.indent}while (True):")
        self.put(f"{2 * self.indent}set_digital_out(1, get_digital_in(2))")
        self.put(f"{2 * self.indent}sync()")
        self.put(f"{self.indent}end")
        self.put("end")
        self.put(f"{self.fresh('id')} = run {name}()")

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
    return _Writer(random.Random(seed), statements, depth).program()


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
