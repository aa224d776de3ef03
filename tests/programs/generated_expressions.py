"""Expressions of generated programs: their text, in one of many spellings, and their value."""

import numpy as np
from scipy.spatial.transform import Rotation

DOWN = Rotation.from_rotvec([np.pi, 0.0, 0.0])
HOME = (0.0, -1.2, 1.8, -2.2, -1.57, 0.0)


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


class ExpressionWriter:
    """Lines, what is known of them, and what each variable holds where the next line is written."""

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
