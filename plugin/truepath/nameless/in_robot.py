"""Nameless forms within the robot: parts that go off with joints which are not their own, or bend, or hang."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import casadi as ca

from truepath.context import Context
from truepath.effects.base import EffectParameter, Term
from truepath.motions import COMPONENTS, Moves
from truepath.nameless.form import Nameless, harmonics, parameters, parts
from truepath.robot import NominalRobot

CYCLES = (1, 2, 3)
USUAL_LOAD_NM = 20.0


def waves_of_a_joint(moves: Moves, joint: int | None, by: int, most: int = 4) -> Term:
    """Whatever moves, as a smooth function of the angle of joint ``by`` (from 1)."""
    features = [f"linear q{by}", *(f"{wave} {k} q{by}" for k in range(1, most + 1) for wave in ("cos", "sin"))]
    own = parameters(parts(moves), features, "waves")
    return Term("joint by joint", moves, joint, (f"q{by}",), (), own)


def _one_joint_by_another(robot: NominalRobot, context: Context) -> list[Term]:
    joints = range(1, robot.num_joints + 1)
    return [waves_of_a_joint(Moves.JOINT, joint, other, 3) for joint in joints for other in joints if other != joint]


def _one_joint_by_two(robot: NominalRobot, context: Context) -> list[Term]:
    names = [f"q{i + 1}" for i in range(robot.num_joints)]
    return [
        Term(
            "joint by two joints",
            Moves.JOINT,
            joint,
            tuple(names),
            (),
            tuple(
                parameter
                for a, b in combinations(names, 2)
                for parameter in parameters(
                    COMPONENTS[Moves.JOINT],
                    [f"{wave} {k} {a}{sign}{b}" for k in (1, 2) for sign in "+-" for wave in ("cos", "sin")],
                    f"{a} and {b}",
                )
            ),
        )
        for joint in range(1, robot.num_joints + 1)
    ]


def _ends_by_joints(robot: NominalRobot, context: Context) -> list[Term]:
    """Base and probe that move with the angle of a joint which is not next to them."""
    terms = []
    for joint in range(1, robot.num_joints + 1):
        features = [f"{wave} {k} q{joint}" for k in CYCLES for wave in ("cos", "sin")]
        for moves, next_to in ((Moves.BASE, 1), (Moves.PROBE, robot.num_joints)):
            if joint != next_to:
                own = parameters(parts(moves), features, f"joint {joint}")
                terms.append(Term("base or probe by joint", moves, None, (f"q{joint}",), (), own))
    return terms


def _wave(feature: str, reading: Mapping[str, ca.SX]) -> ca.SX:
    """``cos 2 q3``, ``sin 1 q2+q5``, ``linear q3``."""
    kind, *number, of = feature.split(" ")
    first, sign, second = of.partition("+") if "+" in of else of.partition("-")
    angle = reading[first] if not sign else reading[first] + (1 if sign == "+" else -1) * reading[second]
    if kind == "linear":
        return angle
    return {"cos": ca.cos, "sin": ca.sin}[kind](int(number[0]) * angle)


def _bending(robot: NominalRobot, context: Context) -> list[Term]:
    own = (
        EffectParameter("rx moment_x", "rad/(N m)", 1e-6, "bending"),
        EffectParameter("ry moment_y", "rad/(N m)", 1e-6, "bending"),
    )
    joints = range(1, robot.num_joints + 1)
    return [Term("bending", Moves.AXIS, joint, ("moment_x", "moment_y"), (), own) for joint in joints]


def _uneven_stiffness(robot: NominalRobot, context: Context) -> list[Term]:
    """Gears that harden or soften under load: compliance alone takes their stiffness for constant."""
    own = parameters(COMPONENTS[Moves.JOINT], ["square", "cube"], "load")
    joints = range(1, robot.num_joints + 1)
    return [Term("uneven stiffness", Moves.JOINT, joint, ("gravity_torque",), (), own) for joint in joints]


def _power_of_load(feature: str, reading: Mapping[str, ca.SX]) -> ca.SX:
    load = reading["gravity_torque"] / USUAL_LOAD_NM
    return load * ca.fabs(load) if feature == "square" else load**3


def _hanging_probe(robot: NominalRobot, context: Context) -> list[Term]:
    own = tuple(
        parameter
        for degree in (1, 2, 3)
        for parameter in parameters(("x", "y", "z"), harmonics("down", degree), f"degree {degree}")
    )
    return [Term("hanging probe", Moves.PROBE, None, ("down_x", "down_y", "down_z"), (), own)]


def monomial(feature: str, reading: Mapping[str, ca.SX]) -> ca.SX:
    """``down 2 1 0``: a product of powers of three readings."""
    name, *powers = feature.split(" ")
    out = ca.SX(1)
    for axis, power in zip("xyz", powers, strict=True):
        out = out * reading[f"{name}_{axis}"] ** int(power)
    return out


FORMS = (
    Nameless("joint by joint", "a joint's error goes with the angle of another joint", _one_joint_by_another, _wave),
    Nameless(
        "joint by two joints",
        "a joint's error goes with the angles of two joints at once",
        _one_joint_by_two,
        _wave,
    ),
    Nameless(
        "base or probe by joint",
        "base or probe moves with the angle of a joint that is not next to it",
        _ends_by_joints,
        _wave,
    ),
    Nameless(
        "bending",
        "links, bearings or the pedestal bend across the axes under the weight of the arm",
        _bending,
        lambda feature, reading: reading[feature],
    ),
    Nameless(
        "uneven stiffness",
        "a joint gives way by more, or by less, than in proportion to its load",
        _uneven_stiffness,
        _power_of_load,
    ),
    Nameless(
        "hanging probe",
        "the probe moves in its holder with the direction in which gravity pulls at it",
        _hanging_probe,
        monomial,
    ),
)
