"""One measured visit of a pose, and its row in the data set. Frames: M of the tracker, E the probe."""

from __future__ import annotations

from dataclasses import dataclass

from truepath import lie
from truepath.lie import Array
from truepath.recording.readings import Reading


@dataclass(frozen=True, eq=False)
class Visit:
    """What was recorded at one row of the pose list.

    Attributes:
        row: of the pose list, from 0.
        pose_id: the same for repeated visits of a pose.
        q_rad: ``(n,)`` commanded joints.
        q_actual_rad: ``(n,)`` mean of the actual joints during the reading.
        temperatures_c: ``(n,)`` of the joints.
        approach: ``(n,)`` in {-1, 0, 1}, direction in which each joint arrived, 0 where it is not known.
        time_s: since the campaign began.
        payload_kg: on the flange.
        reading: of the tracker.
    """

    row: int
    pose_id: int
    q_rad: Array
    q_actual_rad: Array
    temperatures_c: Array
    approach: Array
    time_s: float
    payload_kg: float
    reading: Reading


@dataclass(frozen=True, eq=False)
class Recorded:
    """Visits that are on the disk.

    Attributes:
        row: ``(K,)`` of the pose list, from 0.
        q_rad: ``(K, n)`` commanded joints.
        p_ME: ``(K, 3)`` what the tracker said, m.
    """

    row: Array
    q_rad: Array
    p_ME: Array


def columns(num_joints: int, with_orientation: bool) -> list[str]:
    """The header: what the design document names, then what else is known, which ``calibrate`` passes over."""
    joints = range(1, num_joints + 1)
    return [
        *(f"q{i}_rad" for i in joints),
        "x_mm",
        "y_mm",
        "z_mm",
        *(["qw", "qx", "qy", "qz"] if with_orientation else []),
        "t_s",
        "temperature_c",
        "payload_kg",
        *(f"approach{i}" for i in joints),
        "pose_id",
        "visit",
        "spread_mm",
        "readings",
        *(f"q{i}_actual_rad" for i in joints),
        *(f"temperature{i}_c" for i in joints),
    ]


def cells(visit: Visit) -> list[str]:
    """The row, in the order of ``columns``; ``visit`` counts the rows of the pose list from 1."""
    reading = visit.reading
    quaternion = [] if reading.R_ME is None else lie.to_quaternion(reading.R_ME[None])[0]
    return [
        *(f"{angle:.12f}" for angle in visit.q_rad),
        *(f"{1e3 * coordinate:.6f}" for coordinate in reading.p_ME),
        *(f"{part:.12f}" for part in quaternion),
        f"{visit.time_s:.3f}",
        f"{visit.temperatures_c.mean():.3f}",
        f"{visit.payload_kg:.4f}",
        *(f"{int(direction)}" for direction in visit.approach),
        f"{visit.pose_id}",
        f"{visit.row + 1}",
        f"{reading.spread_mm:.6f}",
        f"{reading.count}",
        *(f"{angle:.9f}" for angle in visit.q_actual_rad),
        *(f"{temperature:.2f}" for temperature in visit.temperatures_c),
    ]
