"""What an expression of URScript can be worth before the program runs, and the functions that need nothing but values.

Truth values, numbers and strings are Python's; lists are tuples. Poses: metres and rotation vectors, rad.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from truepath.lie import Array


@dataclass(frozen=True, slots=True)
class Pose:
    """``p[x, y, z, rx, ry, rz]``."""

    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class JointsOf:
    """``get_inverse_kin(pose, qnear)``: joints that reach a pose, with the tool in force or a stated one."""

    pose: Pose
    q_near: tuple[float, ...] | None
    tool: Pose | None


@dataclass(frozen=True, slots=True)
class Unknown:
    """Nobody can tell before the program runs.

    Attributes:
        why: in plain words.
        literals: line and column of each that it may stand for.
    """

    why: str
    literals: frozenset[tuple[int, int]] = frozenset()


Value = Any  # bool, float, str, tuple, Pose, JointsOf, Unknown


def is_number(value: Value) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def is_joints(value: Value) -> bool:
    """A list of numbers that can stand for joints."""
    return isinstance(value, tuple) and len(value) == 6 and all(is_number(each) for each in value)


def matrix(pose: Pose) -> Array:
    """``(4, 4)``."""
    X = np.eye(4)
    X[:3, 3] = pose.values[:3]
    X[:3, :3] = Rotation.from_rotvec(pose.values[3:]).as_matrix()
    return X


def pose_of(X: Array) -> Pose:
    """The pose of a matrix ``(4, 4)``."""
    return Pose((*X[:3, 3].tolist(), *Rotation.from_matrix(X[:3, :3]).as_rotvec().tolist()))


def _pose_add(one: Pose, other: Pose) -> Pose:
    """Positions added, rotations one after the other (URScript manual)."""
    X = matrix(one)
    Y = matrix(other)
    Z = np.eye(4)
    Z[:3, 3] = X[:3, 3] + Y[:3, 3]
    Z[:3, :3] = X[:3, :3] @ Y[:3, :3]
    return pose_of(Z)


def _pose_sub(to: Pose, start: Pose) -> Pose:
    X, Y = matrix(to), matrix(start)
    Z = np.eye(4)
    Z[:3, 3] = X[:3, 3] - Y[:3, 3]
    Z[:3, :3] = X[:3, :3] @ Y[:3, :3].T
    return pose_of(Z)


def _interpolate(one: Pose, other: Pose, part: float) -> Pose:
    X, Y = matrix(one), matrix(other)
    Z = np.eye(4)
    Z[:3, 3] = X[:3, 3] + part * (Y[:3, 3] - X[:3, 3])
    turn = Rotation.from_matrix(Y[:3, :3] @ X[:3, :3].T).as_rotvec()
    Z[:3, :3] = Rotation.from_rotvec(part * turn).as_matrix() @ X[:3, :3]
    return pose_of(Z)


def _distance(one: Value, other: Value) -> float:
    return float(np.linalg.norm(np.subtract(_numbers(one)[:3], _numbers(other)[:3])))


def _pose_dist(one: Pose, other: Pose) -> float:
    return float(np.linalg.norm(_numbers(_pose_sub(one, other))))


def _numbers(value: Value) -> tuple[float, ...]:
    return value.values if isinstance(value, Pose) else value


def _norm(value: Value) -> float:
    return abs(value) if is_number(value) else float(np.linalg.norm(_numbers(value)))


def _rpy_to_rotation_vector(rpy: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(Rotation.from_euler("xyz", rpy).as_rotvec().tolist())


def _rotation_vector_to_rpy(vector: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(Rotation.from_rotvec(vector).as_euler("xyz").tolist())


def _length(value: Value) -> int:
    return len(_numbers(value)) if isinstance(value, (Pose, tuple)) else len(value)


# What each takes: n number, p pose, l list of numbers or pose, v list of three numbers, s anything with a length.
PURE: dict[str, tuple[str, Callable[..., Value]]] = {
    "d2r": ("n", math.radians),
    "r2d": ("n", math.degrees),
    "sin": ("n", math.sin),
    "cos": ("n", math.cos),
    "tan": ("n", math.tan),
    "asin": ("n", math.asin),
    "acos": ("n", math.acos),
    "atan": ("n", math.atan),
    "atan2": ("nn", math.atan2),
    "sqrt": ("n", math.sqrt),
    "pow": ("nn", lambda base, exponent: float(base) ** float(exponent)),
    "log": ("nn", lambda base, x: math.log(x) / math.log(base)),
    "floor": ("n", math.floor),
    "ceil": ("n", math.ceil),
    "norm": ("l", _norm),
    "length": ("s", _length),
    "size": ("s", _length),
    "get_list_length": ("s", _length),
    "pose_trans": ("pp", lambda one, other: pose_of(matrix(one) @ matrix(other))),
    "pose_inv": ("p", lambda pose: pose_of(np.linalg.inv(matrix(pose)))),
    "pose_add": ("pp", _pose_add),
    "pose_sub": ("pp", _pose_sub),
    "pose_dist": ("pp", _pose_dist),
    "point_dist": ("pp", _distance),
    "interpolate_pose": ("ppn", _interpolate),
    "rpy2rotvec": ("v", _rpy_to_rotation_vector),
    "rotvec2rpy": ("v", _rotation_vector_to_rpy),
}


def _fits(kind: str, value: Value) -> bool:
    if kind == "n":
        return is_number(value)
    if kind == "p":
        return isinstance(value, Pose)
    if kind == "s":
        return isinstance(value, (Pose, tuple, str))
    if is_number(value):
        return kind == "l"
    numbers = value.values if isinstance(value, Pose) else value
    return isinstance(numbers, tuple) and all(map(is_number, numbers)) and (kind == "l" or len(numbers) == 3)


def call_pure(name: str, arguments: list[Value]) -> Value:
    """The value of a function of the table; Unknown where its arguments do not fit."""
    kinds, function = PURE[name]
    if len(arguments) != len(kinds) or not all(map(_fits, kinds, arguments)):
        return Unknown(f"{name}() is called with something else than it takes")
    try:
        value = function(*arguments)
    except (ValueError, ZeroDivisionError, OverflowError, np.linalg.LinAlgError):
        return Unknown(f"{name}() has no value here")
    return value if all_finite(value) else Unknown(f"{name}() has no value here")


def all_finite(value: Value) -> bool:
    """Whether a value holds no number that is none."""
    if isinstance(value, Pose):
        return all(map(math.isfinite, value.values))
    if isinstance(value, tuple):
        return all(map(all_finite, value))
    return not is_number(value) or math.isfinite(value)
