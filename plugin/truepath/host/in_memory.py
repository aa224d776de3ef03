"""Measured poses that a host has in memory, as a data set."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from truepath import lie
from truepath.errors import InputError
from truepath.host.arm_in_plant import ArmInPlant
from truepath.lie import Array
from truepath.measurements import Measurements, check_joint_limits
from truepath.robot import NominalRobot

NAME = "memory"
ROTATION_TOLERANCE = 1e-6

MeasuredIn = Literal["world", "tracker"]
Probe = Literal["tool", "unknown"] | Array


def as_measurements(
    place: ArmInPlant,
    q_rad: Array,
    p_ME: Array,
    R_ME: Array | None,
    measured_in: MeasuredIn,
    probe: Probe | None,
    circumstances: dict[str, Any],
) -> Measurements:
    """See ``CalibrationPlugin.measurements``."""
    n = place.robot.num_joints
    q_rad = _numbers("q_rad", q_rad, (None, n))
    N = len(q_rad)
    p_ME = _numbers("positions", p_ME, (N, 3))
    if R_ME is not None:
        R_ME = _numbers("rotations", R_ME, (N, 3, 3))
        off = np.abs(R_ME @ np.swapaxes(R_ME, 1, 2) - np.eye(3)).max(axis=(1, 2))
        if not ((off < ROTATION_TOLERANCE) & (np.linalg.det(R_ME) > 0)).all():
            row = int(np.argmax(~((off < ROTATION_TOLERANCE) & (np.linalg.det(R_ME) > 0))))
            raise InputError(f"measurement {row + 1} has a matrix that is no rotation", found=str(R_ME[row].tolist()))
    shapes = {"approach": (N, n)}
    given: dict[str, Any] = {}
    for name, values in circumstances.items():
        if values is not None:
            given[name] = _numbers(name, values, shapes.get(name, (N,)))
    if "time_s" in given and (np.diff(given["time_s"]) < 0).any():
        raise InputError("time runs backwards", expected="rows in the order of measurement")
    if "pose_id" in given:
        given["pose_id"] = given["pose_id"].astype(int)
    measurements = Measurements(
        q_rad=q_rad,
        p_ME=p_ME,
        R_ME=R_ME,
        X_MB_nominal=stated_base(place.robot, measured_in),
        X_FE_nominal=stated_probe(place, probe),
        source=NAME,
        **given,
    )
    check_joint_limits(measurements, place.robot, NAME)
    return measurements


def stated_base(robot: NominalRobot, measured_in: MeasuredIn) -> Array | None:
    """X_MB as the host has it; None where the measurement frame is anywhere."""
    if measured_in == "world":
        return robot.X_WB
    if measured_in == "tracker":
        return None
    raise InputError(f"unknown measurement frame {measured_in!r}", expected="world or tracker")


def stated_probe(place: ArmInPlant, probe: Probe | None) -> Array | None:
    """X_FE as stated; None where nobody knows. Unless stated otherwise it is the tool frame, if there is one."""
    if isinstance(probe, str):
        if probe == "unknown":
            return None
        if probe != "tool":
            raise InputError(f"unknown probe {probe!r}", expected="tool, unknown, or its place on the flange")
        if place.tool is None:
            raise InputError("the plugin has no tool frame that could be the probe", expected="tool_frame given to it")
        return place.X_FT
    if probe is None:
        return None if place.tool is None else place.X_FT
    probe = np.asarray(probe, float)
    if probe.shape == (3,) and np.isfinite(probe).all():
        return lie.make_pose(translation=probe)
    if probe.shape == (4, 4) and np.isfinite(probe).all():
        return probe
    raise InputError("cannot read the place of the probe", expected="(3,) or (4, 4) on the flange, m", found=str(probe))


def _numbers(name: str, values: Any, shape: tuple[int | None, ...]) -> Array:
    try:
        array = np.array(values, float)
    except (TypeError, ValueError):
        raise InputError(f"{name} are no numbers") from None
    if array.ndim != len(shape) or any(want not in (None, got) for want, got in zip(shape, array.shape, strict=True)):
        wanted = " x ".join("N" if size is None else str(size) for size in shape)
        raise InputError(f"{name} have the wrong shape", expected=wanted, found=" x ".join(map(str, array.shape)))
    if not np.isfinite(array).all():
        row = int(np.argmin(np.isfinite(array).reshape(len(array), -1).all(axis=1)))
        raise InputError(f"{name} are no numbers in row {row + 1}", found=str(array[row]))
    return array
