"""Runs a URScript program as a controller would, with dice for sensors: what its moves are really given.

The second opinion on the corpus and on the generated programs. It follows control flow and resolves nothing, so it
shares no idea with a parser: a target is what every run gives it. The walk is the virtual controller's.
"""

import re

import numpy as np
from truepath.virtual.controller.script_expressions import Leave
from truepath.virtual.controller.script_robot import INVERSE
from truepath.virtual.controller.script_syntax import JOIN, KILL, START, read_syntax
from truepath.virtual.controller.script_values import FUNCTIONS, Pose, checked, matrix
from truepath.virtual.controller.script_walk import Walk

__all__ = ["FUNCTIONS", "MOVES", "differences", "matrix"]
MOVES = {  # parameters in order, and what becomes of the poses or joints among them
    "movej": (("q", "a", "v", "t", "r"), (("q", "joint"),)),
    "movel": (("pose", "a", "v", "t", "r"), (("pose", "linear"),)),
    "movep": (("pose", "a", "v", "r"), (("pose", "process"),)),
    "movec": (("pose_via", "pose_to", "a", "v", "r", "mode"), (("pose_via", "through"), ("pose_to", "arc"))),
    "servoj": (("q", "a", "v", "t", "lookahead_time", "gain"), (("q", "servo"),)),
}
MOST_TURNS, TURNS_OF_ENDLESS = 200, 3


class Reached(list):
    """Joints that the controller finds for a pose; nobody looks at them."""

    def __init__(self, pose, near, tool):
        super().__init__([0.0] * 6)
        self.pose, self.near, self.tool = pose, near, tool


class Run(Walk):
    """One run.

    Attributes:
        moves: a dictionary for each target that was commanded, as in the corpus, in the order of the run.
    """

    def __init__(self, program, seed, forward=None):
        super().__init__(program, [0.0] * 6)
        self.dice, self.flange_at = np.random.default_rng(seed), forward
        self.started, self.moves, self.most_turns = [], [], MOST_TURNS
        for _ in self.program():
            pass
        try:
            for name in self.started:  # what a thread does later, after the main program has changed things
                for _ in self.one_turn(name):
                    pass
        except Leave as leave:
            if leave.how != "halt":
                raise

    def turns(self, endless):
        return range(min(self.most_turns, TURNS_OF_ENDLESS if endless else MOST_TURNS))

    def undefined(self, name, node):
        return self.anything("tcp_pose")  # defined in the installation, or nowhere

    def forward(self, q_rad):
        return self.flange_at(q_rad)

    def outside(self, name, given, named, node):
        yield from ()
        if name.startswith(START):
            self.started.append(name.removeprefix(START))
            return (yield from self.one_turn(self.started[-1]))
        if name in (KILL, JOIN):
            return None
        if name in MOVES:
            names, targets = MOVES[name]
            self.move(node.lineno, dict(zip(names, given, strict=False)) | named, targets)
            return None
        if name == "set_tcp":
            self.tool = Pose(given[0])
            return None
        if name == "get_inverse_kin":
            arguments = dict(zip(INVERSE, given, strict=False)) | named
            return Reached(arguments["x"], arguments.get("qnear"), arguments.get("tcp"))
        return checked(self.anything(name))

    def one_turn(self, name):
        """Of a thread's loop, as if it had the processor only for that long."""
        self.most_turns = 1
        yield from self.call_user(name, [], {}, None, 1)
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
    tree = read_syntax(program)
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
