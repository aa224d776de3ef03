"""Nameless forms of the course of a campaign: time, temperature, and the pose that came before."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import Term
from truepath.effects.steps import clock_of
from truepath.motions import COMPONENTS, Moves
from truepath.nameless.form import Nameless, parameters, parts
from truepath.robot import NominalRobot

TIME_WAVES = 30
SLOW = 6  # half waves
LEAST_ROWS_PER_WAVE = 12


def in_time(moves: Moves, joint: int | None, context: Context, most: int = 8) -> Term:
    """Whatever moves, as a function of time in so many half waves."""
    times = clock_of(context)
    constants = (("start", float(times.min())), ("end", float(times.max())))
    slow = parameters(parts(moves), [f"half-wave {m}" for m in range(1, min(most, SLOW) + 1)], "slow")
    fast = parameters(parts(moves), [f"half-wave {m}" for m in range(SLOW + 1, most + 1)], "fast")
    return Term("time", moves, joint, (context.clock,), constants, slow + fast)


def everywhere(robot: NominalRobot) -> list[tuple[Moves, int | None]]:
    """Joints, base and probe."""
    return [*((Moves.JOINT, i + 1) for i in range(robot.num_joints)), (Moves.BASE, None), (Moves.PROBE, None)]


def _in_time(robot: NominalRobot, context: Context) -> list[Term]:
    if np.ptp(clock_of(context)) <= 0:
        return []
    most = min(TIME_WAVES, len(context) // LEAST_ROWS_PER_WAVE)
    return [in_time(moves, joint, context, most) for moves, joint in everywhere(robot)]


def _half_wave(feature: str, reading: Mapping[str, ca.SX]) -> ca.SX:
    time = reading["time_s"] if "time_s" in reading else reading["row"]
    return ca.cos(np.pi * int(feature.split(" ")[1]) * (time - reading["start"]) / (reading["end"] - reading["start"]))


def _by_temperature(robot: NominalRobot, context: Context) -> list[Term]:
    if context.temperature_c is None:
        return []
    constants = (("mean", float(context.temperature_c.mean())), ("spread", float(context.temperature_c.std()) or 1.0))
    return [
        Term("temperature", moves, joint, ("temperature_c",), constants, parameters(parts(moves), ["linear"], "linear"))
        for moves, joint in everywhere(robot)
    ]


def _by_arrival(robot: NominalRobot, context: Context) -> list[Term]:
    if context.came_by is None:
        return []
    own = parameters(COMPONENTS[Moves.JOINT], ["came_by"], "side")
    return [Term("arrival", Moves.JOINT, i + 1, ("came_by",), (), own) for i in range(robot.num_joints)]


FORMS = (
    Nameless("time", "the error swings, or jumps to and fro, in time", _in_time, _half_wave),
    Nameless(
        "temperature",
        "joint zeros, base or probe go with the temperature",
        _by_temperature,
        lambda feature, reading: (reading["temperature_c"] - reading["mean"]) / reading["spread"],
    ),
    Nameless(
        "arrival",
        "the error goes with the side from which a joint came: record the columns approach1, approach2, ...",
        _by_arrival,
        lambda feature, reading: reading["came_by"],
    ),
)
