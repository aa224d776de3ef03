"""Forms that a cause without a name can take. They compete with the named effects, and nobody is named by them.

Where a pattern in what is left goes with something that no named effect knows (one joint's error with another
joint's angle, the bending of links sideways, the place of the probe, oscillation in time ...), one of these
explains it better than any named effect does, and keeps a wrong name from being given to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import casadi as ca
import numpy as np

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term
from truepath.effects.steps import clock_of
from truepath.motions import COMPONENTS, Moves
from truepath.robot import NominalRobot

CYCLES = (1, 2, 3)
TIME_WAVES = 30
FIELD_DEGREE = 3
LEAST_ROWS_PER_WAVE = 12
BASE_SIZES = {"x": ("m", 1e-4), "y": ("m", 1e-4), "z": ("m", 1e-4)}


@dataclass(frozen=True, eq=False)
class Nameless(Effect):
    """A form: terms that it offers, features of the readings that it multiplies its parameters with.

    A parameter is named ``component feature``.
    """

    name: str
    hint: str
    offer: Callable[[NominalRobot, Context], list[Term]]
    feature: Callable[[str, Mapping[str, ca.SX]], Any]
    cause: str = "not known"
    remedy: str = "not known"

    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        return [self.offer(robot, context)]

    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        moved = {name: ca.SX(0) for name in COMPONENTS[term.moves]}
        for i, parameter in enumerate(term.parameters):
            component, feature = parameter.name.split(" ", 1)
            moved[component] += parameters[i] * self.feature(feature, reading)
        return ca.vertcat(*moved.values())


def _parameter(component: str, feature: str, group: str) -> EffectParameter:
    unit, size = BASE_SIZES.get(component, ("rad", 5e-5))
    return EffectParameter(f"{component} {feature}", unit, size, group)


def _wave(feature: str, reading: Mapping[str, ca.SX]) -> ca.SX:
    """``cos 2 q3``, ``sin 1 q2+q5``, ``linear q3``."""
    kind, *number, of = feature.split(" ")
    first, sign, second = of.partition("+") if "+" in of else of.partition("-")
    angle = reading[first] if not sign else reading[first] + (1 if sign == "+" else -1) * reading[second]
    if kind == "linear":
        return angle
    return {"cos": ca.cos, "sin": ca.sin}[kind](int(number[0]) * angle)


def _one_joint_by_another(robot: NominalRobot, context: Context) -> list[Term]:
    terms = []
    for joint in range(1, robot.num_joints + 1):
        for other in range(1, robot.num_joints + 1):
            if other != joint:
                features = [f"{wave} {k} q{other}" for k in CYCLES for wave in ("cos", "sin")]
                parameters = tuple(_parameter("angle", f, "waves") for f in [*features, f"linear q{other}"])
                terms.append(Term("joint by joint", Moves.JOINT, joint, (f"q{other}",), (), parameters))
    return terms


def _one_joint_by_two(robot: NominalRobot, context: Context) -> list[Term]:
    terms = []
    names = [f"q{i + 1}" for i in range(robot.num_joints)]
    for joint in range(1, robot.num_joints + 1):
        parameters = tuple(
            _parameter("angle", f"{wave} 1 {a}{sign}{b}", f"{a} and {b}")
            for a, b in combinations(names, 2)
            for sign in "+-"
            for wave in ("cos", "sin")
        )
        terms.append(Term("joint by two joints", Moves.JOINT, joint, tuple(names), (), parameters))
    return terms


def _bending(robot: NominalRobot, context: Context) -> list[Term]:
    """Links, bearings and pedestal that give way across the axes."""
    return [
        Term(
            "bending",
            Moves.AXIS,
            joint,
            ("moment_x", "moment_y"),
            (),
            (
                EffectParameter("rx moment_x", "rad/(N m)", 1e-6, "bending"),
                EffectParameter("ry moment_y", "rad/(N m)", 1e-6, "bending"),
            ),
        )
        for joint in range(1, robot.num_joints + 1)
    ]


def _powers(degree: int) -> list[tuple[int, int, int]]:
    return [(i, j, degree - i - j) for i in range(degree + 1) for j in range(degree + 1 - i)]


def _field(robot: NominalRobot, context: Context) -> list[Term]:
    """A smooth function of the place where the probe is seen."""
    if context.p_ME is None:
        return []
    centre, size = context.p_ME.mean(axis=0), float(np.ptp(context.p_ME, axis=0).max()) / 2
    constants = (("size", size), *((f"c_{name}", float(c)) for name, c in zip("xyz", centre, strict=True)))
    parameters = tuple(
        _parameter(component, f"{i} {j} {k}", f"degree {degree}")
        for degree in range(1, FIELD_DEGREE + 1)
        for i, j, k in _powers(degree)
        for component in "xyz"
    )
    return [Term("place", Moves.READING, None, ("p_x", "p_y", "p_z"), constants, parameters)]


def _monomial(feature: str, reading: Mapping[str, ca.SX]) -> ca.SX:
    out = ca.SX(1)
    for name, power in zip("xyz", feature.split(" "), strict=True):
        out = out * ((reading[f"p_{name}"] - reading[f"c_{name}"]) / reading["size"]) ** int(power)
    return out


def in_time(moves: Moves, joint: int | None, context: Context, most: int = 8) -> Term:
    """Whatever moves, as a smooth function of time."""
    components = ("x", "y", "z") if moves is Moves.PROBE else COMPONENTS[moves]
    times = clock_of(context)
    constants = (("start", float(times.min())), ("end", float(times.max())))
    parameters = tuple(
        _parameter(component, f"half-wave {m}", f"{'slow' if m <= 6 else 'fast'}")
        for m in range(1, most + 1)
        for component in components
    )
    return Term("time", moves, joint, (context.clock,), constants, parameters)


def waves_of_a_joint(moves: Moves, joint: int | None, by: int, context: Context, most: int = 4) -> Term:
    """Whatever moves, as a smooth function of the angle of joint ``by`` (from 1)."""
    features = [f"linear q{by}", *(f"{wave} {k} q{by}" for k in range(1, most + 1) for wave in ("cos", "sin"))]
    parameters = tuple(_parameter(c, feature, "waves") for feature in features for c in COMPONENTS[moves])
    return Term("joint by joint", moves, joint, (f"q{by}",), (), parameters)


def _in_time(robot: NominalRobot, context: Context) -> list[Term]:
    times = clock_of(context)
    if np.ptp(times) <= 0:
        return []
    most = min(TIME_WAVES, len(context) // LEAST_ROWS_PER_WAVE)
    joints = [in_time(Moves.JOINT, i + 1, context, most) for i in range(robot.num_joints)]
    return [*joints, in_time(Moves.BASE, None, context, most), in_time(Moves.PROBE, None, context, most)]


def _half_wave(feature: str, reading: Mapping[str, ca.SX]) -> ca.SX:
    time = reading["time_s"] if "time_s" in reading else reading["row"]
    return ca.cos(np.pi * int(feature.split(" ")[1]) * (time - reading["start"]) / (reading["end"] - reading["start"]))


def _by_temperature(robot: NominalRobot, context: Context) -> list[Term]:
    if context.temperature_c is None:
        return []
    constants = (("mean", float(context.temperature_c.mean())), ("spread", float(context.temperature_c.std()) or 1.0))

    def term(moves: Moves, joint: int | None, components: tuple[str, ...]) -> Term:
        parameters = tuple(_parameter(component, "linear", "linear") for component in components)
        return Term("temperature", moves, joint, ("temperature_c",), constants, parameters)

    joints = [term(Moves.JOINT, i + 1, COMPONENTS[Moves.JOINT]) for i in range(robot.num_joints)]
    return [*joints, term(Moves.BASE, None, COMPONENTS[Moves.BASE]), term(Moves.PROBE, None, ("x", "y", "z"))]


def _by_arrival(robot: NominalRobot, context: Context) -> list[Term]:
    if context.came_by is None:
        return []
    parameter = (_parameter("angle", "came_by", "side"),)
    return [Term("arrival", Moves.JOINT, i + 1, ("came_by",), (), parameter) for i in range(robot.num_joints)]


NAMELESS: dict[str, Nameless] = {
    form.name: form
    for form in (
        Nameless(
            "joint by joint", "the error of one joint goes with the angle of another", _one_joint_by_another, _wave
        ),
        Nameless("joint by two joints", "the error of a joint goes with two joints at once", _one_joint_by_two, _wave),
        Nameless(
            "bending",
            "links, bearings or the pedestal bend across the axes under the weight of the arm",
            _bending,
            lambda feature, reading: reading[feature],
        ),
        Nameless("place", "the error goes with the place where the tracker sees the probe", _field, _monomial),
        Nameless("time", "the error swings in time", _in_time, _half_wave),
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
}
