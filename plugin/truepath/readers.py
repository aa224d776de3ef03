"""Readers of measured data by format name: truepath's own CSV and the two published sets."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from truepath import lie
from truepath.errors import InputError
from truepath.measurements import Measurements, check_joint_limits, from_table
from truepath.robot import NominalRobot
from truepath.tables import Table, read_table

UR_JOINTS = tuple(
    f"{joint}_joint" for joint in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
)


def read_measurements(path: str | Path, robot: NominalRobot, format: str = "csv") -> Measurements:
    """Reads a data set and checks that the robot can have taken its poses.

    Args:
        path: the file.
        robot: whose joints they are.
        format: ``csv`` (the design document's), ``jacobi2025`` or ``landgraf2021``.

    Raises:
        InputError: unknown format, and every fault of the file with its line and column.
    """
    if format not in READERS:
        raise InputError(f"unknown format {format!r}", expected="one of " + ", ".join(READERS))
    _require_format(Path(path), format)
    measurements = READERS[format](Path(path), robot)
    check_joint_limits(measurements, robot, path)
    return measurements


def _read_csv(path: Path, robot: NominalRobot) -> Measurements:
    return from_table(read_table(path), robot.num_joints)


def _require_format(path: Path, format: str) -> None:
    """Raises InputError for a file whose first line is that of another format."""
    try:
        if not path.is_file():
            return
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            first_line = file.readline(10_000)
    except OSError:
        return  # what is wrong with the file is told when it is read
    if SIGNATURES[format] in first_line:
        return
    for other, signature in SIGNATURES.items():
        if signature in first_line:
            raise InputError(
                "this looks like data of another format",
                file=path,
                line=1,
                expected=f"the columns of format {format}",
                found=f"the columns of format {other}; give --format {other}",
            )


def _read_jacobi2025(path: Path, robot: NominalRobot) -> Measurements:
    """P. Jacobi, master's thesis, Tsinghua University, 2025: UR5, laser tracker, one reflector.

    Measured = target + difference, in the robot's base frame; the reflector is meant to sit at
    (0, 0, 31) mm on the flange, which the targets agree with but for a constant 0.09 mm in z.
    """
    table = read_table(path)
    joints = [f"joint_{i + 1}" for i in range(6)]
    _six_joints(robot, path, "jacobi2025")
    targets, differences = ["x_t", "y_t", "z_t"], ["x_dif", "y_dif", "z_dif"]
    table.require([*targets, *differences, *joints])
    return Measurements(
        q_rad=np.radians(table.numbers(joints)),
        p_ME=(table.numbers(targets) + table.numbers(differences)) * 1e-3,
        X_MB_nominal=np.eye(4),
        X_FE_nominal=lie.make_pose(translation=np.array([0.0, 0.0, 0.031])),
        **_origin(table),
    )


def _read_landgraf2021(path: Path, robot: NominalRobot) -> Measurements:
    """C. Landgraf et al., IEEE CASE 2021: UR10, laser tracker with a 6D probe, decimal comma.

    Where the tracker stands and how the probe sits on the flange are unknown.
    """
    table = read_table(path, delimiter=";", decimal=",")
    _six_joints(robot, path, "landgraf2021")
    position = [f"measurement_{axis}" for axis in "xyz"]
    angles = [f"measurement_r{axis}" for axis in "xyz"]
    table.require(["Timestamp", *UR_JOINTS, "measurement_temperature", *position, *angles])
    rotation = Rotation.from_euler("XYZ", table.numbers(angles), degrees=True)
    return Measurements(
        q_rad=table.numbers(UR_JOINTS),
        p_ME=table.numbers(position) * 1e-3,
        R_ME=np.asarray(rotation.as_matrix()),
        time_s=_seconds(table, "Timestamp"),
        temperature_c=table.numbers(["measurement_temperature"])[:, 0],
        **_origin(table),
    )


def _six_joints(robot: NominalRobot, path: Path, name: str) -> None:
    if robot.num_joints != 6:
        raise InputError(
            f"{name} is a format of six-joint robots",
            file=path,
            expected="a robot with 6 joints",
            found=f"{robot.name} with {robot.num_joints}",
        )


def _seconds(table: Table, name: str) -> np.ndarray:
    """Seconds since the first row, from YYYYMMDDhhmmss."""
    stamps = []
    for cell, line in zip(table.text(name), table.lines, strict=True):
        try:
            if not re.fullmatch("[0-9]{14}", cell):  # strptime would also read fewer digits
                raise ValueError
            stamps.append(datetime.strptime(cell, "%Y%m%d%H%M%S"))
        except ValueError:
            raise InputError(
                "not a time stamp", file=table.file, line=int(line), column=name, expected="YYYYMMDDhhmmss", found=cell
            ) from None
    return np.array([(stamp - stamps[0]).total_seconds() for stamp in stamps])


def _origin(table: Table) -> dict:
    return {"line": table.lines, "source": table.file.name, "sha256": hashlib.sha256(table.raw).hexdigest()}


SIGNATURES = {"csv": "q1_", "jacobi2025": "x_dif", "landgraf2021": "Timestamp;Goal x"}
READERS: dict[str, Callable[[Path, NominalRobot], Measurements]] = {
    "csv": _read_csv,
    "jacobi2025": _read_jacobi2025,
    "landgraf2021": _read_landgraf2021,
}


def with_nominal_frames(measurements: Measurements, X_MB: np.ndarray | None, X_FE: np.ndarray | None) -> Measurements:
    """The same data with stated nominal frames; None leaves what the reader knew."""
    return replace(
        measurements,
        X_MB_nominal=measurements.X_MB_nominal if X_MB is None else X_MB,
        X_FE_nominal=measurements.X_FE_nominal if X_FE is None else X_FE,
    )
