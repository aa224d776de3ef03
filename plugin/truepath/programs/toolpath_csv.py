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

    def with_joints(self, q_rad: Array, changed: Array | None = None) -> str:
        """The text of the file with these joints ``(N, n)``; other cells, line ends and byte-order mark stay.

        Args:
            q_rad: for all rows.
            changed: ``(N,)`` rows whose joints are written; None for all. Without joint columns all are.
        """
        decimals = 12 if self.radians_per_unit == 1.0 else 10
        return self._with(self.joint_columns, q_rad / self.radians_per_unit, decimals, changed)

    def with_poses(self, X_BF: Array, changed: Array | None = None) -> str:
        """The same with flange poses ``(N, 4, 4)`` in the pose columns of a path of poses."""
        unit = next(unit for unit in LENGTH_UNITS if f"x_{unit}" in self.table.header)
        columns = [f"{axis}_{unit}" for axis in "xyz"]
        position = X_BF[:, :3, 3] / LENGTH_UNITS[unit]
        quaternion = lie.to_quaternion(X_BF[:, :3, :3])
        assert self.X_BF is not None
        # Of the two quaternions of one orientation the one that is nearer to what was written.
        written = self.table.numbers(QUATERNION_COLUMNS)
        quaternion *= np.where(np.sum(quaternion * written, axis=1, keepdims=True) < 0, -1.0, 1.0)
        return self._with([*columns, *QUATERNION_COLUMNS], np.hstack([position, quaternion]), 10, changed)

    def _with(self, columns: list[str], values: Array, decimals: int, changed: Array | None) -> str:
        header = list(self.table.header)
        added = [name for name in columns if name not in header]
        write = np.ones(len(values), bool) if changed is None or added else changed
        place = {name: index for index, name in enumerate([*header, *added])}
        cells = np.char.mod(f"%.{decimals}f", values)
        places = [place[name] for name in columns]
        rows = []
        for row, numbers, is_written in zip(self.table.rows, cells, write.tolist(), strict=True):
            row = [*row, *[""] * len(added)]
            if is_written:
                for column, cell in zip(places, numbers, strict=True):
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
    table = read_table(path, tell_cut_off=False)  # told among the findings of a correction
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
