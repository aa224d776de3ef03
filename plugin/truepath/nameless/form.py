"""What a nameless form is: parameters times features of a pose, at some place of the chain."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from truepath.context import Context
from truepath.effects.base import Effect, EffectParameter, Term
from truepath.motions import COMPONENTS, Moves
from truepath.robot import NominalRobot

SIZES = {"x": ("m", 1e-4), "y": ("m", 1e-4), "z": ("m", 1e-4), "distance": ("m", 1e-4)}
OTHER_SIZE = ("rad", 5e-5)

Feature = Callable[[str, Mapping[str, ca.SX]], Any]


@dataclass(frozen=True, eq=False)
class Nameless(Effect):
    """A form. A parameter is named ``component feature``.

    Attributes:
        name: for the log.
        hint: what a person is told if the readings follow it.
        offer: its terms for a data set.
        feature: value of a feature, from its name and the readings.
    """

    name: str
    hint: str
    offer: Callable[[NominalRobot, Context], list[Term]]
    feature: Feature
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


def parameters(components: Iterable[str], features: Iterable[str], group: str) -> tuple[EffectParameter, ...]:
    """All features for all components; they share a size."""
    components = tuple(components)
    return tuple(
        EffectParameter(f"{component} {feature}", *SIZES.get(component, OTHER_SIZE), f"{group}, {_kind(component)}")
        for feature in features
        for component in components
    )


def parts(moves: Moves) -> tuple[str, ...]:
    """Components of a motion that make sense for all data: a probe's turn is not seen by a mere reflector."""
    return ("x", "y", "z") if moves is Moves.PROBE else COMPONENTS[moves]


def harmonics(names: Iterable[str], degree: int) -> list[str]:
    """Monomials of exactly that degree in three numbers: ``x 2 1 0``."""
    prefix = "".join(names)
    return [f"{prefix} {i} {j} {degree - i - j}" for i in range(degree + 1) for j in range(degree + 1 - i)]


def _kind(component: str) -> str:
    return "shift" if component in SIZES else "turn"
