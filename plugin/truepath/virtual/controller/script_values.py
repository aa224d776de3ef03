"""Values of URScript, and functions of them that need no robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from truepath.lie import Array
from truepath.virtual.controller.script_instructions import ScriptError, Six

MOST_ELEMENTS, LONGEST_TEXT, LARGEST = 10_000, 10_000, 1e15


class Joints(list[Any]):
    """A list: joints, numbers, an array of poses or of lists.

    Attributes:
        line: where it was written, as long as nothing is done with it.
    """

    line: int | None = None

    @property
    def holds_lists(self) -> bool:
        """An array of arrays, as only the outermost list may be."""
        return any(isinstance(item, list) for item in self)


class Pose(Joints):
    """x, y, z, rx, ry, rz."""


Value: TypeAlias = "bool | int | float | str | Joints | None"


def as_list(items: Iterable[Any]) -> Joints:
    """A list of values.

    Raises:
        ScriptError: too long, or lists in lists in lists.
    """
    found = Joints(items)
    if len(found) > MOST_ELEMENTS or any(isinstance(item, Joints) and item.holds_lists for item in found):
        raise ScriptError("a list that is too long or too deep")
    return found


def as_pose(numbers: Iterable[Any]) -> Pose:
    """A pose.

    Raises:
        ScriptError: not six numbers.
    """
    return Pose(six([*numbers], "a pose"))


def six(numbers: Any, what: str = "a target") -> Six:
    """Six numbers as floats.

    Raises:
        ScriptError: this is something else.
    """
    if not isinstance(numbers, (list, tuple)) or len(numbers) != 6 or not all(map(is_number, numbers)):
        raise ScriptError(f"{what} has six numbers")
    return tuple(map(float, numbers))


def is_number(value: Any) -> bool:
    """Truth values are none."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def number(value: Any, what: str, least: float = -math.inf) -> float:
    """A number as float.

    Raises:
        ScriptError: this is something else, or less than the least.
    """
    if not is_number(value) or value < least:
        raise ScriptError(f"{what} is no number" + (f" of {least:g} or more" if least > -math.inf else ""))
    return float(value)


def checked(value: Any) -> Any:
    """A value of a size that a controller can hold.

    Raises:
        ScriptError: larger than that, or nothing that URScript knows.
    """
    if isinstance(value, (bool, Joints)) or value is None:
        return value
    if isinstance(value, (int, float)):
        if not abs(value) <= LARGEST:
            raise ScriptError("a number that is too large, or none")
        return value
    if isinstance(value, (np.floating, np.integer, np.bool_)):
        return checked(value.item())
    if isinstance(value, str):
        if len(value) > LONGEST_TEXT:
            raise ScriptError("a text that is too long")
        return value
    if isinstance(value, (list, tuple)):
        return as_list(checked(item) for item in value)
    raise ScriptError(f"a value that URScript does not know ({type(value).__name__})")


def copied(value: Any) -> Any:
    """URScript has no references: what is assigned is a copy."""
    if not isinstance(value, Joints):
        return value
    copy = type(value)(value)
    copy.line = value.line
    return copy


def matrix(pose: Iterable[float]) -> Array:
    """``(4, 4)``."""
    numbers = [*pose]
    X = np.eye(4)
    X[:3, :3] = Rotation.from_rotvec(numbers[3:]).as_matrix()
    X[:3, 3] = numbers[:3]
    return X


def vector(X: Array) -> Pose:
    """The Pose that a ``(4, 4)`` is."""
    return Pose([*X[:3, 3].tolist(), *Rotation.from_matrix(X[:3, :3]).as_rotvec().tolist()])


def _interpolated(start: Pose, end: Pose, share: float) -> Pose:
    R_start = Rotation.from_rotvec(start[3:])
    turn = (R_start.inv() * Rotation.from_rotvec(end[3:])).as_rotvec()
    place = np.array(start[:3]) + share * np.subtract(end[:3], start[:3])
    return Pose([*place.tolist(), *(R_start * Rotation.from_rotvec(share * turn)).as_rotvec().tolist()])


def _combined(p: Pose, q: Pose, sign: int) -> Pose:
    R_q = Rotation.from_rotvec(q[3:])
    turn = Rotation.from_rotvec(p[3:]) * (R_q if sign > 0 else R_q.inv())
    return Pose([*(np.array(p[:3]) + sign * np.array(q[:3])).tolist(), *turn.as_rotvec().tolist()])


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "d2r": math.radians,
    "r2d": math.degrees,
    "sqrt": math.sqrt,
    "pow": math.pow,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "atan2": math.atan2,
    "log": lambda base, x: math.log(x, base),
    "floor": math.floor,
    "ceil": math.ceil,
    "norm": lambda x: float(np.linalg.norm(x)),
    "length": len,
    "get_list_length": len,
    "to_str": lambda x: said(x),
    "str_cat": lambda a, b: said(a) + said(b),
    "point_dist": lambda p, q: float(np.linalg.norm(np.subtract(p[:3], q[:3]))),
    "pose_trans": lambda p, q: vector(matrix(p) @ matrix(q)),
    "pose_inv": lambda p: vector(np.linalg.inv(matrix(p))),
    "pose_add": lambda p, q: _combined(p, q, 1),
    "pose_sub": lambda p, q: _combined(p, q, -1),
    "interpolate_pose": _interpolated,
}


def said(value: Any) -> str:
    """As a message shows it."""
    if isinstance(value, Joints):
        shown = ", ".join(map(said, value[:100]))
        return f"p[{shown}]" if isinstance(value, Pose) else f"[{shown}]"
    return value if isinstance(value, str) else f"{value:.6g}" if isinstance(value, float) else str(value)
