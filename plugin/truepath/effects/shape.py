"""What the terms of an effect may look like. Terms come from files too, and those may say anything."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from truepath.motions import Moves

if TYPE_CHECKING:
    from truepath.effects.base import Term

COVERED = ("lower_rad", "upper_rad")
IN_ORDER = (("lower_rad", "upper_rad"), ("start", "end"))
POSITIVE = ("tau_s", "soft_torque")


@dataclass(frozen=True)
class Shape:
    """One way in which the terms of an effect are built.

    Attributes:
        moves: what they move.
        inputs: what they depend on; alternatives are separated by ``|``.
        constants: that each must have. ``default`` of an input may be there or not.
        parameters: pattern of a name to its unit.
    """

    moves: Moves
    inputs: tuple[str, ...] = ()
    constants: tuple[str, ...] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)

    def fits(self, term: Term) -> bool:
        """Whether a term is of this shape and its numbers make sense."""
        if term.moves is not self.moves or len(term.inputs) != len(self.inputs):
            return False
        if any(name not in wanted.split("|") for name, wanted in zip(term.inputs, self.inputs, strict=True)):
            return False
        constants = dict(term.constants)
        optional = {f"default {name}" for name in term.inputs}
        if len(constants) != len(term.constants) or set(constants) - optional != set(self.constants):
            return False
        names = [parameter.name for parameter in term.parameters]
        return (
            _make_sense(constants)
            and len(set(names)) == len(names)
            and all(self._unit(parameter.name) == parameter.unit for parameter in term.parameters)
        )

    def _unit(self, name: str) -> str | None:
        return next((unit for pattern, unit in self.parameters.items() if re.fullmatch(pattern, name)), None)


def _make_sense(constants: Mapping[str, float]) -> bool:
    return (
        all(math.isfinite(value) for value in constants.values())
        and all(constants[low] < constants[high] for low, high in IN_ORDER if low in constants)
        and all(constants[name] > 0 for name in POSITIVE if name in constants)
        and 0.0 <= constants.get("share", 0.5) <= 1.0
    )
