"""Whether two nominal robots are the same arm, and what differs if not.

Compared is the geometry, to the nanometre: axes and flange at zero, in the base. Names of joints and of the model do
not count (hosts prefix them), nor do limits, masses and where the base stands.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truepath import lie
from truepath.errors import InputError
from truepath.lie import Array
from truepath.robot import NominalRobot

SAME = 1.5e-9  # m and entries of a direction: two numbers that are the same when rounded to the nanometre
TOLD = 4


def require_same_robot(
    wanted: NominalRobot,
    given: NominalRobot,
    problem: str = "the calibration belongs to another robot",
    file: str | Path | None = None,
) -> None:
    """Refuses a robot of another geometry.

    Raises:
        InputError: with the numbers that differ.
    """
    differences = what_differs(wanted, given)
    if differences:
        more = [f"and {len(differences) - TOLD} differences more"] * (len(differences) > TOLD)
        raise InputError(
            problem,
            file=None if file is None else Path(file),
            expected=f"the geometry of {wanted.name}; names of joints and limits do not count",
            found=f"{given.name}: " + "; ".join([*differences[:TOLD], *more]),
        )


def what_differs(wanted: NominalRobot, given: NominalRobot) -> list[str]:
    """What is otherwise with the second robot, in words with both numbers; empty for the same arm."""
    n = wanted.num_joints
    if given.num_joints != n:
        return [f"{given.num_joints} joints instead of {n}: {', '.join(given.joint_names)}"]
    found = []
    for i, (length, other) in enumerate(zip(_link_lengths(given), _link_lengths(wanted), strict=True)):
        if abs(length - other) > SAME:
            to = "the flange" if i == n - 1 else f"axis {i + 2}"
            found.append(f"from axis {i + 1} to {to} {_mm(length)} instead of {_mm(other)}")
    off = np.abs(given.screws_B - wanted.screws_B).max(axis=1) > SAME
    for i in np.flatnonzero(off).tolist():
        z, other = given.screws_B[i, :3], wanted.screws_B[i, :3]
        angle = float(np.degrees(np.arctan2(np.linalg.norm(np.cross(z, other)), z @ other)))
        beside = _mm(_beside(wanted.X_BA[i, :3, 3], given.X_BA[i]))
        found.append(f"axis {i + 1} ({given.joint_names[i]}) at zero lies {beside} away and points {angle:.4g} deg off")
    if not off.any() and np.abs(given.X_BF - wanted.X_BF).max() > SAME:
        away = _mm(float(np.linalg.norm(given.X_BF[:3, 3] - wanted.X_BF[:3, 3])))
        turned = np.degrees(np.linalg.norm(lie.rotation_vector(given.X_BF[:3, :3].T @ wanted.X_BF[:3, :3])))
        found.append(f"all axes agree, but the flange is {away} and {turned:.4g} deg away (see flange_frame)")
    return found


def _link_lengths(robot: NominalRobot) -> Array:
    """``(n,)`` shortest distance from each axis to the next one, and from the last to the flange, m."""
    z, p = robot.X_BA[:, :3, 2], robot.X_BA[:, :3, 3]
    normal = np.cross(z[:-1], z[1:])
    size, along = np.linalg.norm(normal, axis=1), np.diff(p, axis=0)
    skew = np.abs(np.einsum("ij,ij->i", normal, along)) / np.where(size > SAME, size, 1.0)
    parallel = np.linalg.norm(np.cross(z[:-1], along), axis=1)
    return np.append(np.where(size > SAME, skew, parallel), _beside(robot.X_BF[:3, 3], robot.X_BA[-1]))


def _beside(point: Array, X_BA: Array) -> float:
    """Distance of a point from an axis, m."""
    return float(np.linalg.norm(np.cross(X_BA[:3, 2], point - X_BA[:3, 3])))


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.6g} mm"
