"""Columns that carry their unit in their name, and quaternions: what data sets and toolpaths share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array
from truepath.tables import Table

ANGLE_UNITS = {"rad": 1.0, "deg": np.pi / 180.0}
LENGTH_UNITS = {"mm": 1e-3, "m": 1.0}
QUATERNION_COLUMNS = ("qw", "qx", "qy", "qz")
QUATERNION_NORM_TOLERANCE = 1e-3


def unit_columns(table: Table, quantities: list[str], units: dict[str, float]) -> tuple[list[str], float]:
    """Names of the columns of all quantities, in one common unit, and the factor to SI."""
    for quantity in quantities:
        present = [f"{quantity}_{unit}" for unit in units if f"{quantity}_{unit}" in table.header]
        if len(present) > 1:
            raise InputError(
                "a quantity appears in two units",
                file=table.file,
                line=1,
                column=present[1],
                expected="one column",
                found=" and ".join(present),
            )
    found = [u for u in units if any(f"{quantity}_{u}" in table.header for quantity in quantities)]
    if len(found) > 1:
        raise InputError(
            "the units of " + ", ".join(quantities) + " differ",
            file=table.file,
            line=1,
            expected="one unit for all",
            found=" and ".join(found),
        )
    unit = found[0] if found else next(iter(units))
    names = [f"{quantity}_{unit}" for quantity in quantities]
    table.require(names)
    return names, units[unit]


def unit_quaternions(table: Table, names: Sequence[str]) -> Array:
    """``(N, 4)`` normalised quaternions; raises InputError for one whose length is not 1."""
    quaternion = table.numbers(names)
    length = np.linalg.norm(quaternion, axis=1)
    bad = np.abs(length - 1.0) > QUATERNION_NORM_TOLERANCE
    if bad.any():
        k = int(np.argmax(bad))
        raise InputError(
            "the quaternion is not of unit length",
            file=table.file,
            line=int(table.lines[k]),
            column=", ".join(names),
            expected=f"length 1 within {QUATERNION_NORM_TOLERANCE}",
            found=f"{length[k]:.6f}",
        )
    return quaternion / length[:, None]
