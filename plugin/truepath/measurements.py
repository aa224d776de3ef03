"""A measured data set: commanded joints and where the probe really was. Columns, units and checks of the design."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from truepath import lie
from truepath.columns import ANGLE_UNITS, LENGTH_UNITS, QUATERNION_COLUMNS, unit_columns, unit_quaternions
from truepath.errors import InputError
from truepath.lie import Array
from truepath.robot import NominalRobot
from truepath.splits import random_parts
from truepath.tables import Table

OTHER_UNITS = {"t": "s", "temperature": "c", "payload": "kg"}
SAME_POSE_RAD = 1e-3
FARTHEST_M = 1000.0
ABSOLUTE_ZERO_C = -273.15
LIMIT_TOLERANCE_RAD = np.radians(2.0)


@dataclass(frozen=True)
class Measurements:
    """N measured poses in the order of measurement, SI units.

    Frames: M measurement frame (tracker or cell), B robot base, F flange, E probe or reflector.

    Attributes:
        q_rad: ``(N, n)`` commanded joint angles.
        p_ME: ``(N, 3)`` measured position of the probe, m.
        R_ME: ``(N, 3, 3)`` measured orientation, None for a mere reflector.
        time_s, temperature_c, payload_kg: ``(N,)`` context or None.
        approach: ``(N, n)`` in {-1, 0, 1}, direction in which each joint arrived, or None.
        pose_id: ``(N,)`` group number, equal for repeated visits of one pose, or None.
        line: ``(N,)`` line of each pose in its file.
        X_MB_nominal, X_FE_nominal: ``(4, 4)`` where base and probe are meant to be, None where nobody knows.
        source, sha256: file name and hash of its bytes.
    """

    q_rad: Array
    p_ME: Array
    R_ME: Array | None = None
    time_s: Array | None = None
    temperature_c: Array | None = None
    payload_kg: Array | None = None
    approach: Array | None = None
    pose_id: Array | None = None
    line: Array = field(default_factory=lambda: np.zeros(0, int))
    X_MB_nominal: Array | None = None
    X_FE_nominal: Array | None = None
    source: str = "memory"
    sha256: str = ""

    def __post_init__(self) -> None:
        if len(self.line) != len(self.q_rad):
            object.__setattr__(self, "line", np.arange(len(self.q_rad)) + 2)
        if not self.sha256:
            content = self.q_rad.tobytes() + self.p_ME.tobytes()
            object.__setattr__(self, "sha256", hashlib.sha256(content).hexdigest())

    def __len__(self) -> int:
        return len(self.q_rad)

    @property
    def has_orientation(self) -> bool:
        return self.R_ME is not None

    @property
    def extra_payload_kg(self) -> Array | float:
        """``(N,)`` payload on the flange beyond what the robot's model carries; 0 where none was recorded."""
        return 0.0 if self.payload_kg is None else self.payload_kg

    def subset(self, rows: Array) -> Measurements:
        """The poses picked by an index or boolean array, in that order."""
        per_pose = ("q_rad", "p_ME", "R_ME", "time_s", "temperature_c", "payload_kg", "approach", "pose_id", "line")
        parts: dict[str, Any] = {name: getattr(self, name) for name in per_pose}
        picked: dict[str, Any] = {name: None if part is None else part[rows] for name, part in parts.items()}
        return replace(self, **picked)

    def groups(self) -> Array:
        """``(N,)`` group number of each pose, counted from 0: repeated visits of one pose share it."""
        if self.pose_id is None:
            return np.arange(len(self))
        return np.unique(self.pose_id, return_inverse=True)[1]

    def folds(self, count: int, seed: int = 0) -> list[Array]:
        """Row numbers of ``count`` random parts of nearly equal size; visits of one pose stay together."""
        return random_parts(self.groups(), count, seed)


def from_table(table: Table, num_joints: int) -> Measurements:
    """The truepath CSV of the design document.

    Raises:
        InputError: every fault of a file, with line and column.
    """
    _check_units(table, num_joints)
    q_names, q_factor = unit_columns(table, [f"q{i + 1}" for i in range(num_joints)], ANGLE_UNITS)
    q_rad = table.numbers(q_names) * q_factor
    p_names, p_factor = unit_columns(table, ["x", "y", "z"], LENGTH_UNITS)
    R_ME = None
    if any(name in table.header for name in QUATERNION_COLUMNS):
        table.require(QUATERNION_COLUMNS)
        R_ME = lie.from_quaternion(unit_quaternions(table, QUATERNION_COLUMNS))
    approach = None
    approach_names = [f"approach{i + 1}" for i in range(num_joints)]
    if any(name in table.header for name in approach_names):
        table.require(approach_names)
        approach = table.numbers(approach_names)
        _reject(table, ~np.isin(approach, (-1, 0, 1)), approach_names, "not a direction of arrival", "-1, 0 or 1")
    time_s = _optional(table, "t_s")
    if time_s is not None and np.any(np.diff(time_s) < 0):
        k = int(np.argmax(np.diff(time_s) < 0)) + 1
        raise InputError(
            "time runs backwards",
            file=table.file,
            line=int(table.lines[k]),
            column="t_s",
            expected=f"rows in the order of measurement, {time_s[k - 1]} or later",
            found=str(time_s[k]),
        )
    pose_id = None
    if "pose_id" in table.header:
        names = np.array(table.text("pose_id"))
        _reject(table, (names == "")[:, None], ["pose_id"], "the name of a pose is missing", "a name in every row")
        pose_id = np.unique(names, return_inverse=True)[1]
        _require_same_joints(table, q_rad, pose_id)
    p_ME = table.numbers(p_names) * p_factor
    _reject(table, np.abs(p_ME) > FARTHEST_M, p_names, "no tracker measures so far", f"within {FARTHEST_M:g} m")
    payload_kg = _optional(table, "payload_kg")
    if payload_kg is not None:
        _reject(table, (payload_kg < 0)[:, None], ["payload_kg"], "a payload cannot be negative", "0 or more")
    temperature_c = _optional(table, "temperature_c")
    if temperature_c is not None:
        cold = (temperature_c < ABSOLUTE_ZERO_C)[:, None]
        _reject(table, cold, ["temperature_c"], "nothing is that cold", f"{ABSOLUTE_ZERO_C} or more")
    return Measurements(
        q_rad=q_rad,
        p_ME=p_ME,
        R_ME=R_ME,
        time_s=time_s,
        temperature_c=temperature_c,
        payload_kg=payload_kg,
        approach=approach,
        pose_id=pose_id,
        line=table.lines,
        source=table.file.name,
        sha256=hashlib.sha256(table.raw).hexdigest(),
    )


def check_joint_limits(measurements: Measurements, robot: NominalRobot, file: str | Path) -> None:
    """Raises InputError for a pose that the robot cannot have taken; recognises degrees read as radians."""
    q = measurements.q_rad
    if q.shape[1] != robot.num_joints:
        raise InputError(
            f"the data has {q.shape[1]} joints", file=file, expected=f"{robot.num_joints} joints of {robot.name}"
        )
    beyond = (q < robot.lower_rad - LIMIT_TOLERANCE_RAD) | (q > robot.upper_rad + LIMIT_TOLERANCE_RAD)
    if not beyond.any():
        return
    k, i = np.argwhere(beyond)[0]
    # One angle beyond is a slip; only where many are have the units been mixed up.
    fits_as_degrees = beyond.mean() > 0.1 and np.all(
        (np.radians(q) >= robot.lower_rad - LIMIT_TOLERANCE_RAD)
        & (np.radians(q) <= robot.upper_rad + LIMIT_TOLERANCE_RAD)
    )
    hint = " (all angles would fit as degrees: were degrees written into a column of radians?)"
    raise InputError(
        "an angle lies far beyond the joint limits",
        file=file,
        line=int(measurements.line[k]),
        column=f"q{i + 1} ({robot.joint_names[i]})",
        expected=f"{robot.lower_rad[i]:.4f} to {robot.upper_rad[i]:.4f} rad",
        found=f"{q[k, i]:.4f} rad" + (hint if fits_as_degrees else ""),
    )


def _require_same_joints(table: Table, q_rad: Array, pose_id: Array) -> None:
    """Visits of one pose must command the same joints, or their barycentre means nothing."""
    first = np.unique(pose_id, return_index=True)[1]
    off = np.abs(q_rad - q_rad[first[pose_id]]).max(axis=1)
    if off.max() > SAME_POSE_RAD:
        k = int(np.argmax(off > SAME_POSE_RAD))
        raise InputError(
            "one pose_id stands for different poses",
            file=table.file,
            line=int(table.lines[k]),
            column="pose_id",
            expected=f"the joints of line {int(table.lines[first[pose_id[k]]])}, the first visit of this pose",
            found=f"a joint that differs by {off[k]:.4g} rad",
        )


def _check_units(table: Table, num_joints: int) -> None:
    """Every name of the vocabulary that carries an unknown unit, or a joint that the robot does not have."""
    joints = [f"q{i + 1}" for i in range(num_joints)]
    approaches = [f"approach{i + 1}" for i in range(num_joints)]
    for name in table.header:
        if re.fullmatch(r"approach\d+", name) and name not in approaches:
            raise _no_such_joint(table, name, f"approach1 to approach{num_joints}")
        match = re.fullmatch(r"(q\d+|x|y|z|t|temperature|payload)_([A-Za-z]+)", name)
        if not match:
            continue
        quantity, unit = match.groups()
        if quantity in OTHER_UNITS:
            known = [OTHER_UNITS[quantity]]
        else:
            known = list(ANGLE_UNITS if quantity[0] == "q" else LENGTH_UNITS)
        if unit not in known:
            raise InputError(
                f"unknown unit {unit!r}",
                file=table.file,
                line=1,
                column=name,
                expected=" or ".join(f"{quantity}_{u}" for u in known),
                found=name,
            )
        if quantity[0] == "q" and quantity not in joints:
            raise _no_such_joint(table, name, f"q1 to q{num_joints}")


def _no_such_joint(table: Table, name: str, expected: str) -> InputError:
    problem = "a column for a joint that the robot does not have"
    return InputError(problem, file=table.file, line=1, column=name, expected=expected)


def _optional(table: Table, name: str) -> Array | None:
    return table.numbers([name])[:, 0] if name in table.header else None


def _reject(table: Table, bad: Array, names: Sequence[str], problem: str, expected: str) -> None:
    if bad.any():
        k, i = np.argwhere(bad)[0]
        found = table.text(names[i])[k]
        raise InputError(
            problem, file=table.file, line=int(table.lines[k]), column=names[i], expected=expected, found=found
        )
