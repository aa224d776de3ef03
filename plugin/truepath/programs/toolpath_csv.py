"""Toolpaths as CSV: joint columns or flange pose columns, any other columns kept as they are."""

from __future__ import annotations

import codecs
import csv
import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truepath import lie
from truepath.columns import ANGLE_UNITS, LENGTH_UNITS, QUATERNION_COLUMNS, unit_columns, unit_quaternions
from truepath.errors import InputError
from truepath.lie import Array
from truepath.tables import Table, read_table


@dataclass(frozen=True)
class Toolpath:
    """A path of N waypoints.

    Attributes:
        table: the file as text.
        q_rad: ``(N, n)`` programmed joints, None for a path of poses.
        X_BF: ``(N, 4, 4)`` programmed flange poses in the robot base, None for a path of joints.
        joint_columns: names of the joint columns, in the file or to be added.
        radians_per_unit: of the joint columns.
    """

    table: Table
    q_rad: Array | None
    X_BF: Array | None
    joint_columns: list[str]
    radians_per_unit: float

    def with_joints(self, q_rad: Array) -> str:
        """The text of the file with these joints ``(N, n)``; other cells, line ends and byte-order mark stay."""
        header = list(self.table.header)
        added = [name for name in self.joint_columns if name not in header]
        place = {name: index for index, name in enumerate([*header, *added])}
        decimals = 12 if self.radians_per_unit == 1.0 else 10
        cells = np.char.mod(f"%.{decimals}f", q_rad / self.radians_per_unit)
        columns = [place[name] for name in self.joint_columns]
        rows = []
        for row, joints in zip(self.table.rows, cells, strict=True):
            row = [*row, *[""] * len(added)]
            for column, cell in zip(columns, joints, strict=True):
                row[column] = str(cell)
            rows.append(row)
        out = io.StringIO(newline="")
        if self.table.raw.startswith(codecs.BOM_UTF8):
            out.write("\ufeff")
        writer = csv.writer(out, lineterminator="\r\n" if b"\r\n" in self.table.raw else "\n")
        writer.writerow([*header, *added])
        writer.writerows(rows)
        return out.getvalue()


def read_toolpath(path: str | Path, num_joints: int) -> Toolpath:
    """Reads ``q1_rad ...`` or ``q1_deg ...``, or else ``x_mm, y_mm, z_mm`` (or m) with ``qw, qx, qy, qz``.

    With joint columns, pose columns are extra columns like any others.

    Raises:
        InputError: neither joints nor poses, or a fault of the file with line and column.
    """
    table = read_table(path)
    joints = [f"q{i + 1}" for i in range(num_joints)]
    for name in table.header:
        match = re.fullmatch(r"(q\d+)_(rad|deg)", name)
        if match and match[1] not in joints:
            raise InputError(
                "a column for a joint that the robot does not have",
                file=table.file,
                line=1,
                column=name,
                expected=f"q1 to q{num_joints}",
            )
    if any(f"{joint}_{unit}" in table.header for joint in joints for unit in ANGLE_UNITS):
        names, factor = unit_columns(table, joints, ANGLE_UNITS)
        return Toolpath(table, table.numbers(names) * factor, None, names, factor)
    if any(f"x_{unit}" in table.header for unit in LENGTH_UNITS):
        names, factor = unit_columns(table, ["x", "y", "z"], LENGTH_UNITS)
        table.require(QUATERNION_COLUMNS)
        rotation = lie.from_quaternion(unit_quaternions(table, QUATERNION_COLUMNS))
        X_BF = lie.make_pose(rotation, table.numbers(names) * factor)
        return Toolpath(table, None, X_BF, [f"{joint}_rad" for joint in joints], 1.0)
    raise InputError(
        "this is no toolpath",
        file=table.file,
        line=1,
        expected=f"columns q1_rad ... q{num_joints}_rad (or _deg), or x_mm, y_mm, z_mm, qw, qx, qy, qz",
        found=", ".join(table.header),
    )
