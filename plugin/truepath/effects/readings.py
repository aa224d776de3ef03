"""What the motion of an effect may depend on, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from truepath import poe
from truepath.context import Context
from truepath.lie import Array
from truepath.robot import NominalRobot

OF_A_POSE = ("theta", "gravity_torque", "moment_x", "moment_y", "approach", "came_by")
OF_A_CAMPAIGN = ("time_s", "row", "temperature_c")
OF_A_READING = ("p_x", "p_y", "p_z", "distance", "azimuth", "elevation", "beam_x", "beam_y", "beam_z")
OF_THE_FLANGE = ("down_x", "down_y", "down_z")


def is_reading(name: str, num_joints: int) -> bool:
    """Whether there is a reading of that name for a robot of so many joints."""
    return name in (
        *OF_A_POSE,
        *OF_A_CAMPAIGN,
        *OF_A_READING,
        *OF_THE_FLANGE,
        *(f"q{i + 1}" for i in range(num_joints)),
    )


def readings(
    robot: NominalRobot, context: Context, inputs: Sequence[str], joint: int | None, constants: Mapping[str, float]
) -> list[Array]:
    """``(N,)`` arrays for the inputs of a term.

    Known are, of the term's own joint: ``theta``, ``gravity_torque`` (N m), ``moment_x``, ``moment_y`` (the moment
    of gravity across the axis, N m), ``approach``, ``came_by``; ``q3`` of any joint; ``time_s``, ``row``,
    ``temperature_c``; of the probe as the tracker sees it ``p_x``, ``p_y``, ``p_z``, ``distance`` (m), ``azimuth``,
    ``elevation`` (rad); along the axes of the flange the unit vectors ``beam_x`` ... from the tracker and
    ``down_x`` ... of gravity. What was not recorded takes the value of the constant
    ``default ...``, else 0.
    """
    own = 0 if joint is None else joint - 1
    moments: list[Array] = []

    def moment(component: int) -> Array:
        if not moments:
            moments.append(robot.gravity_moment(context.q_rad, context.known_payload_kg))
        return moments[0][:, own, component]

    def column(values: Array | None, index: int) -> Array | None:
        return None if values is None else values[:, index]

    def of_the_campaign(name: str) -> Array | None:
        family, _, axis = name.partition("_")
        if family == "p":
            return column(context.p_ME, "xyz".index(axis))
        if family == "down":
            return _down(robot, context)[:, "xyz".index(axis)]
        if family == "beam":
            return column(_beam(context), "xyz".index(axis))
        if name in ("distance", "azimuth", "elevation"):
            return None if context.p_ME is None else polar(context.p_ME)[name]
        return getattr(context, name)

    own_readings: dict[str, Callable[[], Array | None]] = {
        "theta": lambda: context.q_rad[:, own],
        "gravity_torque": lambda: moment(2),
        "moment_x": lambda: moment(0),
        "moment_y": lambda: moment(1),
        "approach": lambda: column(context.approach, own),
        "came_by": lambda: column(context.came_by, own),
    }
    found = []
    for name in inputs:
        values: Array | None
        if name in own_readings:
            values = own_readings[name]()
        elif name[0] == "q":
            values = context.q_rad[:, int(name[1:]) - 1]
        else:
            values = of_the_campaign(name)
        found.append(np.full(len(context), constants.get(f"default {name}", 0.0)) if values is None else values)
    return found


def _down(robot: NominalRobot, context: Context) -> Array:
    R_BF = poe.flange_poses(robot, np.zeros(4 * robot.num_joints + 12), context.q_rad)[:, :3, :3]
    weight = np.linalg.norm(robot.gravity_B)
    return np.einsum("kji,j->ki", R_BF, robot.gravity_B / (weight if weight > 0 else 1.0))


def _beam(context: Context) -> Array | None:
    if context.R_MF is None or context.p_ME is None:
        return None
    towards = context.p_ME / np.maximum(np.linalg.norm(context.p_ME, axis=1, keepdims=True), 1e-9)
    return np.einsum("kji,kj->ki", context.R_MF, towards)


def polar(p_ME: Array) -> dict[str, Array]:
    """Distance, azimuth (about its mean direction, so that it does not jump) and elevation of points ``(N, 3)``."""
    distance = np.linalg.norm(p_ME, axis=1)
    middle = np.arctan2(p_ME[:, 1].mean(), p_ME[:, 0].mean())
    across = np.cos(middle) * p_ME[:, 1] - np.sin(middle) * p_ME[:, 0]
    along = np.cos(middle) * p_ME[:, 0] + np.sin(middle) * p_ME[:, 1]
    return {
        "distance": distance,
        "azimuth": np.arctan2(across, along),
        "elevation": np.arcsin(p_ME[:, 2] / np.maximum(distance, 1e-9)),
    }
