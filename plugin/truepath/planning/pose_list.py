"""The file of poses to be driven and measured: ``plan`` writes it, ``record`` drives it.

CSV with the columns of a data set as far as they are known beforehand: ``pose_id,measure,q1_rad,...,qn_rad``. Rows
are driven in order, all joints in step. ``measure`` is 1 where the robot stops to be measured and 0 where it only
passes: on a detour, or at the point from which a pose is to be approached. ``pose_id`` is the same for repeated
visits of a pose and empty where nothing is measured. ``robot``, which may be missing, is the same in every row: the
name of the model for which the poses were planned and the hash of its geometry. ``q*_deg`` is understood too; without
``measure`` every row is measured, without ``pose_id`` every pose is one of its own.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from truepath.columns import ANGLE_UNITS, unit_columns
from truepath.errors import InputError
from truepath.lie import Array
from truepath.tables import Table, read_table

if TYPE_CHECKING:
    from truepath.robot import NominalRobot

NO_POSE = -1
ROBOT_MARK = r"[A-Za-z0-9_.-]{1,40}:[0-9a-f]{12}"
MOST_POSE_ID = 10**9
SAME_POSE_RAD = 1e-6


@dataclass(frozen=True, eq=False)
class PoseList:
    """N joint targets in the order in which they are driven.

    Attributes:
        q_rad: ``(N, n)``.
        measure: ``(N,)`` bool, whether the robot stops there to be measured.
        pose_id: ``(N,)`` int, the same for repeated visits of one pose; ``NO_POSE`` (-1) where nothing is measured.
        robot: for which they were planned, see ``robot_mark``; empty if that is not known.
    """

    q_rad: Array
    measure: Array
    pose_id: Array
    robot: str = ""

    def __len__(self) -> int:
        return len(self.q_rad)


def read_pose_list(path: str | Path) -> PoseList:
    """Reads and checks a file of poses.

    Raises:
        InputError: every fault of the file, with line and column.
    """
    table = read_table(path)
    numbers = sorted({int(m[1]) for name in table.header if (m := re.fullmatch(r"q([1-9]\d{0,2})_(rad|deg)", name))})
    joints = [f"q{i + 1}" for i in range(max(numbers, default=1))]
    names, factor = unit_columns(table, joints, ANGLE_UNITS)
    strange = [name for name in table.header if name not in (*names, "measure", "pose_id", "robot")]
    if strange:
        raise InputError(
            "a file of poses to be measured has no such column",
            file=table.file,
            line=1,
            column=strange[0],
            expected=", ".join(["pose_id", "measure", *names, "robot"]),
            found=strange[0],
        )
    q_rad = table.numbers(names) * factor
    measure = _measure(table)
    pose_id = _pose_id(table, measure)
    if not measure.any():
        raise InputError("nothing is to be measured", file=table.file, expected="measure 1 in at least one row")
    _require_same_joints(table, q_rad, pose_id)
    return PoseList(q_rad, measure, pose_id, _robot(table))


def to_csv(poses: PoseList) -> str:
    """The file as text, joints to the nanoradian."""
    robot = [poses.robot] if poses.robot else []
    header = [
        "pose_id",
        "measure",
        *(f"q{i + 1}_rad" for i in range(poses.q_rad.shape[1])),
        *(["robot"] if robot else []),
    ]
    rows = (
        [str(pose) if pose >= 0 else "", "1" if stop else "0", *(f"{angle:.9f}" for angle in q), *robot]
        for pose, stop, q in zip(poses.pose_id.tolist(), poses.measure.tolist(), poses.q_rad.tolist(), strict=True)
    )
    return "\n".join(",".join(row) for row in (header, *rows)) + "\n"


def robot_mark(robot: NominalRobot) -> str:
    """The name of a model and the beginning of the hash of its geometry, as in ``ur5:70edbdbe4e25``."""
    name = robot.name if re.fullmatch(r"[\w.-]{1,40}", robot.name, re.ASCII) else "robot"
    return f"{name}:{robot.model_sha256[:12]}"


def _robot(table: Table) -> str:
    if "robot" not in table.header:
        return ""
    cells = table.text("robot")
    for cell, line in zip(cells, table.lines, strict=True):
        if cell != cells[0]:
            raise _bad(table, int(line), "robot", "poses of two robots in one list", repr(cells[0]), cell)
        if not re.fullmatch(ROBOT_MARK, cell):
            raise _bad(table, int(line), "robot", "this names no robot", "a name and a hash, ur5:0123456789ab", cell)
    return cells[0]


def _measure(table: Table) -> Array:
    if "measure" not in table.header:
        return np.ones(len(table), bool)
    cells = table.text("measure")
    for cell, line in zip(cells, table.lines, strict=True):
        if cell not in ("0", "1"):
            raise _bad(table, int(line), "measure", "to be measured or not?", "1 or 0", cell)
    return np.array([cell == "1" for cell in cells])


def _pose_id(table: Table, measure: Array) -> Array:
    """``(N,)``; a pose of its own for every measured row where the file names none."""
    if "pose_id" not in table.header:
        return np.where(measure, np.cumsum(measure) - 1, NO_POSE)
    found = np.full(len(table), NO_POSE)
    for k, (cell, line) in enumerate(zip(table.text("pose_id"), table.lines, strict=True)):
        if cell == "" and not measure[k]:
            continue
        if not re.fullmatch(r"[0-9]{1,10}", cell) or int(cell) > MOST_POSE_ID:
            raise _bad(table, int(line), "pose_id", "the number of a pose is missing", "a whole number from 0 on", cell)
        if not measure[k]:
            problem = "a pose that is not measured has a number"
            raise _bad(table, int(line), "pose_id", problem, "an empty cell where measure is 0", cell)
        found[k] = int(cell)
    return found


def _require_same_joints(table: Table, q_rad: Array, pose_id: Array) -> None:
    """Visits of one pose must go to the same joints, or comparing them means nothing."""
    measured = np.flatnonzero(pose_id != NO_POSE)
    first, group = np.unique(pose_id[measured], return_index=True, return_inverse=True)[1:]
    off = np.abs(q_rad[measured] - q_rad[measured[first[group]]]).max(axis=1)
    if off.max() > SAME_POSE_RAD:
        k = int(np.argmax(off > SAME_POSE_RAD))
        raise InputError(
            "one pose_id stands for different poses",
            file=table.file,
            line=int(table.lines[measured[k]]),
            column="pose_id",
            expected=f"the joints of line {int(table.lines[measured[first[group[k]]]])}, the first visit of this pose",
            found=f"a joint that differs by {off[k]:.4g} rad",
        )


def _bad(table: Table, line: int, column: str, problem: str, expected: str, found: str) -> InputError:
    return InputError(problem, file=table.file, line=line, column=column, expected=expected, found=repr(found))
