"""What the motion of an effect may depend on, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from truepath.context import Context
from truepath.lie import Array
from truepath.robot import NominalRobot

OF_A_POSE = ("theta", "gravity_torque", "moment_x", "moment_y", "approach", "came_by")
OF_A_CAMPAIGN = ("time_s", "row", "temperature_c", "p_x", "p_y", "p_z")


def is_reading(name: str, num_joints: int) -> bool:
    """Whether there is a reading of that name for a robot of so many joints."""
    return name in (*OF_A_POSE, *OF_A_CAMPAIGN, *(f"q{i + 1}" for i in range(num_joints)))


def readings(
    robot: NominalRobot, context: Context, inputs: Sequence[str], joint: int | None, constants: Mapping[str, float]
) -> list[Array]:
    """``(N,)`` arrays for the inputs of a term.

    Known are, of the term's own joint: ``theta``, ``gravity_torque`` (N m), ``moment_x``, ``moment_y`` (the moment
    of gravity across the axis, N m), ``approach``, ``came_by``; ``q3`` of any joint; ``time_s``, ``row``,
    ``temperature_c``; ``p_x``, ``p_y``, ``p_z`` (m). What was not recorded takes the value of the constant
    ``default ...``, else 0.
    """
    own = 0 if joint is None else joint - 1
    moments: list[Array] = []

    def moment(component: int) -> Array:
        if not moments:
            payload = 0.0 if context.payload_kg is None else context.payload_kg
            moments.append(robot.gravity_moment(context.q_rad, payload))
        return moments[0][:, own, component]

    def column(values: Array | None, index: int) -> Array | None:
        return None if values is None else values[:, index]

    known: dict[str, Callable[[], Array | None]] = {
        "theta": lambda: context.q_rad[:, own],
        "gravity_torque": lambda: moment(2),
        "moment_x": lambda: moment(0),
        "moment_y": lambda: moment(1),
        "approach": lambda: column(context.approach, own),
        "came_by": lambda: column(context.came_by, own),
        "time_s": lambda: context.time_s,
        "row": lambda: context.row,
        "temperature_c": lambda: context.temperature_c,
        "p_x": lambda: column(context.p_ME, 0),
        "p_y": lambda: column(context.p_ME, 1),
        "p_z": lambda: column(context.p_ME, 2),
    }
    found = []
    for name in inputs:
        values = known[name]() if name in known else context.q_rad[:, int(name[1:]) - 1]
        found.append(np.full(len(context), constants.get(f"default {name}", 0.0)) if values is None else values)
    return found
