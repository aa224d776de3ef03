"""Runs a URScript program as a controller would, with dice for sensors: what its moves are really given.

The second opinion on the corpus and on the generated programs. It follows control flow and resolves nothing, so it
shares no idea with a parser: a target is what every run gives it. One statement a line, which the programs here keep
to, so that each line becomes a line of Python syntax; the tree is walked, never executed.
"""

import ast
import re

import numpy as np
from scipy.spatial.transform import Rotation

MOVES = {  # parameters in order, and what becomes of the poses or joints among them
    "movej": (("q", "a", "v", "t", "r"), (("q", "joint"),)),
    "movel": (("pose", "a", "v", "t", "r"), (("pose", "linear"),)),
    "movep": (("pose", "a", "v", "r"), (("pose", "process"),)),
    "movec": (("pose_via", "pose_to", "a", "v", "r", "mode"), (("pose_via", "through"), ("pose_to", "arc"))),
    "servoj": (("q", "a", "v", "t", "lookahead_time", "gain"), (("q", "servo"),)),
}
INVERSE = ("x", "qnear", "maxPositionError", "maxOrientationError", "tcp")
WITHOUT_EFFECT = re.compile(r"\$|(kill|join)\b|(enter_critical|exit_critical)$")
MOST_TURNS, TURNS_OF_ENDLESS = 200, 3


class Pose(list):
    """x, y, z, rx, ry, rz."""

    line = None  # where it was written, as long as nothing is done with it


class Joints(list):
    """A list that was written just like that."""

    line = None


class Reached:
    """Joints that the controller finds for a pose."""

    def __init__(self, pose, near, tool):
        self.pose, self.near, self.tool = pose, near, tool


def _copied(value):
    copy = type(value)(value)
    if hasattr(value, "line"):
        copy.line = value.line
    return copy


class _Leave(BaseException):
    """The way out of a loop, a function or the program; no error."""

    def __init__(self, how, value=None):
        self.how, self.value = how, value


def matrix(pose):
    """``(4, 4)``."""
    X = np.eye(4)
    X[:3, :3] = Rotation.from_rotvec(pose[3:]).as_matrix()
    X[:3, 3] = pose[:3]
    return X


def vector(X):
    """The Pose that a ``(4, 4)`` is."""
    return Pose([*X[:3, 3].tolist(), *Rotation.from_matrix(X[:3, :3]).as_rotvec().tolist()])


def _interpolated(start, end, share):
    R_start = Rotation.from_rotvec(start[3:])
    turn = (R_start.inv() * Rotation.from_rotvec(end[3:])).as_rotvec()
    place = np.array(start[:3]) + share * np.subtract(end[:3], start[:3])
    return Pose([*place, *(R_start * Rotation.from_rotvec(share * turn)).as_rotvec()])


def _combined(p, q, sign):
    R_q = Rotation.from_rotvec(q[3:])
    turn = Rotation.from_rotvec(p[3:]) * (R_q if sign > 0 else R_q.inv())
    return Pose([*(np.array(p[:3]) + sign * np.array(q[:3])), *turn.as_rotvec()])


FUNCTIONS = {
    "d2r": np.radians,
    "r2d": np.degrees,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "floor": np.floor,
    "norm": lambda x: float(np.linalg.norm(x)),
    "point_dist": lambda p, q: float(np.linalg.norm(np.subtract(p[:3], q[:3]))),
    "get_list_length": len,
    "pose_trans": lambda p, q: vector(matrix(p) @ matrix(q)),
    "pose_inv": lambda p: vector(np.linalg.inv(matrix(p))),
    "pose_add": lambda p, q: _combined(p, q, 1),
    "pose_sub": lambda p, q: _combined(p, q, -1),
    "interpolate_pose": _interpolated,
}


def syntax(text):
    """Python's syntax tree of a program, its lines those of the program, and the names of its secondary programs."""
    depth, lines, secondary = 0, [], set()
    for line in re.split(r"\r?\n", text.removeprefix("\ufeff")):
        line = re.sub(r'"[^"]*"|#.*', lambda found: "" if found[0][0] == "#" else '""', line).strip()
        line = re.sub(r"\bp\[", "POSE[", line.replace(":=", "="))
        line = re.sub(r"\brun\s+(\w+)\s*\(", r"START_\1(", line)
        line = re.sub(r"^(global|local)\s+(\w+)\s*=(?!=)", r"\2: \1_ =", line)
        if line.startswith("sec "):
            secondary.add(re.match(r"sec\s+(\w+)", line)[1])
        line = re.sub(r"^(thread|sec)\b", "def", line)
        if line == "end":
            lines.append("  " * depth + "pass")  # a block may hold nothing but comments
            depth -= 1
        elif re.match(r"(else|elif)\b", line):
            lines.append("  " * (depth - 1) + line)
        else:
            lines.append("  " * depth + ("pass" if WITHOUT_EFFECT.match(line) else line) if line else "")
            depth += bool(re.match(r"(def|while|if)\b", line))
    return ast.parse("\n".join(lines)), secondary


class Run:
    """One run.

    Attributes:
        moves: a dictionary for each target that was commanded, as in the corpus, in the order of the run.
    """

    def __init__(self, program, seed, forward=None):
        tree, secondary = program
        self.dice, self.forward = np.random.default_rng(seed), forward
        self.globals, self.functions, self.threads, self.moves = {}, {}, [], []
        self.tool = [0.0] * 6
        self.depth, self.most_turns = 0, MOST_TURNS
        bare = [node for node in tree.body if not isinstance(node, ast.FunctionDef)]
        try:
            self.block(tree.body, self.globals)
            if not bare:
                (main,) = (node.name for node in tree.body if node.name not in secondary)
                self.call_user(main, [], {})
            for name in self.threads:  # what a thread does later, after the main program has changed things
                self.call_thread(name)
        except _Leave as leave:
            if leave.how != "halt":
                raise

    # --- statements

    def block(self, nodes, scope):
        for node in nodes:
            self.statement(node, scope)

    def statement(self, node, scope):
        match node:
            case ast.FunctionDef():
                self.functions[node.name] = node
            case ast.Pass():
                pass
            case ast.AnnAssign():
                where = self.globals if node.annotation.id == "global_" else scope
                where[node.target.id] = self.value(node.value, scope)
            case ast.Assign():
                self.assign(node.targets[0], self.value(node.value, scope), scope)
            case ast.Expr(value=ast.Name(id="halt")):
                raise _Leave("halt")
            case ast.Expr():
                self.value(node.value, scope)
            case ast.Return():
                raise _Leave("return", None if node.value is None else self.value(node.value, scope))
            case ast.Break():
                raise _Leave("break")
            case ast.Continue():
                raise _Leave("continue")
            case ast.If():
                self.block(node.body if self.value(node.test, scope) else node.orelse, scope)
            case ast.While():
                self.loop(node, scope)
            case _:
                raise NotImplementedError(ast.dump(node))

    def loop(self, node, scope):
        endless = isinstance(node.test, ast.Constant)
        for _ in range(min(self.most_turns, TURNS_OF_ENDLESS if endless else MOST_TURNS)):
            if not self.value(node.test, scope):
                return
            try:
                self.block(node.body, scope)
            except _Leave as leave:
                if leave.how == "break":
                    return
                if leave.how != "continue":
                    raise

    def assign(self, target, value, scope):
        """Values are copied: URScript has no references."""
        value = _copied(value) if isinstance(value, list) else value
        if isinstance(target, ast.Subscript):
            where = self.globals if target.value.id not in scope else scope
            changed = type(where[target.value.id])(where[target.value.id])
            changed[int(self.value(target.slice, scope))] = value
            where[target.value.id] = changed
        elif target.id not in scope and (target.id in self.globals or self.depth <= 1):
            self.globals[target.id] = value  # what the program's first level assigns is global
        else:
            scope[target.id] = value

    # --- expressions

    def value(self, node, scope):
        match node:
            case ast.Constant():
                return node.value
            case ast.Name():
                return self.named(node.id, scope)
            case ast.List() | ast.Tuple():
                return self.written(Joints(self.value(item, scope) for item in node.elts), node)
            case ast.Subscript(value=ast.Name(id="POSE")):
                return self.written(Pose(self.value(node.slice, scope)), node)
            case ast.Subscript():
                return self.value(node.value, scope)[int(self.value(node.slice, scope))]
            case ast.UnaryOp():
                inner = self.value(node.operand, scope)
                return (
                    (not inner) if isinstance(node.op, ast.Not) else -inner if isinstance(node.op, ast.USub) else inner
                )
            case ast.BoolOp():
                values = [bool(self.value(item, scope)) for item in node.values]
                return all(values) if isinstance(node.op, ast.And) else any(values)
            case ast.BinOp():
                return self.arithmetic(node.op, self.value(node.left, scope), self.value(node.right, scope))
            case ast.Compare(ops=[op], comparators=[right]):
                return self.compared(op, self.value(node.left, scope), self.value(right, scope))
            case ast.Call():
                return self.call(node, scope)
        raise NotImplementedError(ast.dump(node))

    def written(self, value, node):
        value.line = node.lineno
        return value

    def named(self, name, scope):
        if name in scope or name in self.globals:
            return scope[name] if name in scope else self.globals[name]
        return self.anything("tcp_pose")  # defined in the installation, or nowhere

    def arithmetic(self, op, left, right):
        match op:
            case ast.Add():
                return left + right
            case ast.Sub():
                return left - right
            case ast.Mult():
                return left * right
            case ast.Div():
                return left / right
        raise NotImplementedError(ast.dump(op))

    def compared(self, op, left, right):
        match op:
            case ast.Eq():
                return left == right
            case ast.NotEq():
                return left != right
            case ast.Lt():
                return left < right
            case ast.LtE():
                return left <= right
            case ast.Gt():
                return left > right
            case ast.GtE():
                return left >= right
        raise NotImplementedError(ast.dump(op))

    # --- calls

    def call(self, node, scope):
        name = node.func.id
        given = [self.value(item, scope) for item in node.args]
        named = {item.arg: self.value(item.value, scope) for item in node.keywords}
        if name in self.functions:
            return self.call_user(name, given, named)
        if name.startswith("START_"):
            self.threads.append(name.removeprefix("START_"))
            return self.call_thread(self.threads[-1])
        if name in MOVES:
            names, targets = MOVES[name]
            self.move(node.lineno, dict(zip(names, given, strict=False)) | named, targets)
            return None
        if name == "set_tcp":
            self.tool = list(given[0])
            return None
        if name == "get_inverse_kin":
            arguments = dict(zip(INVERSE, given, strict=False)) | named
            return Reached(arguments["x"], arguments.get("qnear"), arguments.get("tcp"))
        if name == "get_forward_kin" and given:
            return vector(self.forward(given[0]))
        return FUNCTIONS[name](*given) if name in FUNCTIONS else self.anything(name)

    def call_user(self, name, given, named):
        node = self.functions[name]
        parameters = [parameter.arg for parameter in node.args.args]
        scope = {}
        for parameter, default in zip(reversed(parameters), reversed(node.args.defaults), strict=False):
            scope[parameter] = self.value(default, self.globals)
        scope |= dict(zip(parameters, given, strict=False)) | named
        self.depth += 1
        try:
            self.block(node.body, scope)
        except _Leave as leave:
            if leave.how != "return":
                raise
            return leave.value
        finally:
            self.depth -= 1
        return None

    def call_thread(self, name):
        """One turn of its loop, as if the thread had the processor only for that long."""
        self.most_turns = 1
        self.call_user(name, [], {})
        self.most_turns = MOST_TURNS

    def move(self, line, arguments, targets):
        stated = {"time_s": arguments["t"]} if arguments.get("t") else {"speed": arguments.get("v")}
        if not arguments.get("t"):
            stated["acceleration"] = arguments.get("a")
        for parameter, kind in targets:
            where, move = arguments[parameter], {"line": line, "kind": kind, "tool": list(self.tool)}
            move["literal"] = getattr(where, "line", None)
            if isinstance(where, Reached):
                move |= {"pose": list(where.pose), "near": where.near}
                move["tool"] = list(self.tool if where.tool is None else where.tool)
            else:
                move |= {"pose" if isinstance(where, Pose) else "joints": list(where)}
            move |= stated if kind != "servo" else {"time_s": arguments.get("t")}
            if kind != "through":
                move["blend_m"] = arguments.get("r")
            self.moves.append(move)

    def anything(self, name):
        """What a sensor, the outer world, or an unknown function may return."""
        if re.search(r"tcp_pose|next_pose", name):
            return Pose(self.dice.uniform(-0.5, 0.5, 6).tolist())
        if "joint_positions" in name:
            return self.dice.uniform(-1, 1, 6).tolist()
        if "socket_read" in name:
            return [int(self.dice.integers(1, 4)), *self.dice.uniform(0, 5, 8).tolist()]
        if re.search(r"digital_in|socket_open", name):
            return bool(self.dice.integers(2))
        if "integer" in name:
            return int(self.dice.integers(0, 5))
        return float(self.dice.uniform(0, 1))


def differences(program, expected, forward=None, most_runs=400, enough=12):
    """What is wrong with the expected targets of a program, as sentences; none if they are what runs of it show.

    Runs until each line has moved, and each unresolved one has moved to two places, and ``enough`` times at least.

    Args:
        program: text.
        expected: ``targets``, ``optional`` (one value each), ``unresolved`` (several), ``not_run``, as in the corpus.
        forward: joints to the ``(4, 4)`` flange, for get_forward_kin.
    """
    tree = syntax(program)
    single = {(t["line"], t["kind"]): t for t in [*expected["targets"], *expected["optional"]]}
    several = {line["line"]: [] for line in expected["unresolved"]}
    handed_on = {t["moved_by"] for t in expected["targets"] if "moved_by" in t}
    seen, wrong = set(), []
    for seed in range(most_runs):
        for move in Run(tree, seed, forward).moves:
            if move["line"] in handed_on:
                move["line"] = move["literal"]
            key = (move["line"], move["kind"])
            if move["line"] in several:
                places = several[move["line"]]
                if len(places) < 2 and not any(_same_target(place, move) for place in places):
                    places.append(move)
            elif key not in single:
                wrong.append(f"{key} is a target, too")
            elif key not in seen or seed < enough:
                seen.add(key)
                wrong += _faults(single[key], move)
        if wrong or (seed >= enough and len(seen) == len(single) and all(len(p) == 2 for p in several.values())):
            return wrong
    return [
        *(f"{key} is never reached" for key in single if key not in seen),
        *(
            f"line {line} has moved to {len(places)} place(s) only"
            for line, places in several.items()
            if len(places) < 2
        ),
    ]


def _same_target(a, b):
    if "joints" in a and "joints" in b:
        return np.allclose(a["joints"], b["joints"], rtol=0, atol=1e-9)
    if "pose" not in a or "pose" not in b:
        return False
    same_tool = np.allclose(matrix(a["tool"]), matrix(b["tool"]), rtol=0, atol=1e-9)
    return same_tool and np.allclose(matrix(a["pose"]), matrix(b["pose"]), rtol=0, atol=1e-9)


def _faults(expected, move):
    where = f"line {move['line']}, {move['kind']}"
    faults = [] if _same_target(expected, move) else [f"{where}: {move} where {expected} is expected"]
    if not np.allclose(matrix(expected["tool"]), matrix(move["tool"]), rtol=0, atol=1e-9):
        faults.append(f"{where}: tool {move['tool']}")
    if not np.allclose(expected.get("near") or 0, move.get("near") or 0, rtol=0, atol=1e-12):
        faults.append(f"{where}: near {move.get('near')}")
    numbers = [name for name in ("speed", "acceleration", "time_s", "blend_m") if name in expected]
    wrong = (n for n in numbers if not np.isclose(expected[n], move.get(n, np.nan), rtol=0, atol=1e-12))
    return faults + [f"{where}: {name} {move.get(name)}" for name in wrong]
