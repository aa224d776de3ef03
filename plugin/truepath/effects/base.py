"""What an effect is: a physical cause that moves something a little, by an amount linear in its parameters.

phi_i = theta_i + sum over effects of delta_phi_i(theta, context); other effects move an axis, the base, the probe
or stretch lengths: see ``motions.Moves``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import ClassVar

import casadi as ca
import numpy as np

from truepath.batched import BatchedFunction
from truepath.context import Context
from truepath.effects.readings import OF_A_POSE, is_reading, readings
from truepath.effects.shape import Shape
from truepath.lie import Array
from truepath.motions import COMPONENTS, OF_ONE_JOINT, ChainPoses, Moves
from truepath.region import fade
from truepath.robot import NominalRobot

NEARLY_A_TURN_RAD, EVERYWHERE_RAD = np.radians(330.0), 8.0 * np.pi
COLUMNS = {"t_s": "time_s", "temperature_c": "temperature_c"}  # of the data, and where a context has them


@dataclass(frozen=True)
class EffectParameter:
    """One number that a fit finds.

    Attributes:
        name: short, unique within its term.
        unit: SI.
        prior_scale: a plausible size, from which a fit starts to learn how large the parameter is.
        group: parameters of one group share the size that the fit learns.
    """

    name: str
    unit: str
    prior_scale: float
    group: str


@dataclass(frozen=True)
class Term:
    """One effect at one place of the robot, as far as a data set can resolve it.

    Attributes:
        effect: name of the effect.
        moves: what it moves.
        joint: number of the joint, from 1; None where the whole robot, its base, the probe or the tracker moves.
        inputs: what the motion depends on, as ``readings.readings`` knows it.
        constants: names and values of numbers that are no parameters: ``lower_rad`` and ``upper_rad``, the angles
            that the data covered and beyond which the term fades to nothing; a reference temperature; a moment.
        parameters: what is to be found.
    """

    effect: str
    moves: Moves
    joint: int | None
    inputs: tuple[str, ...]
    constants: tuple[tuple[str, float], ...]
    parameters: tuple[EffectParameter, ...]

    def constant(self, name: str) -> float:
        """Value of a constant."""
        return dict(self.constants)[name]

    def with_parameters(self, parameters: tuple[EffectParameter, ...]) -> Term:
        """The same term with some of its parameters."""
        return replace(self, parameters=parameters)

    def fits(self, num_joints: int) -> bool:
        """Whether it makes sense for a robot of so many joints."""
        if not all(is_reading(name, num_joints) for name in self.inputs):
            return False
        if self.joint is None:
            return self.moves not in OF_ONE_JOINT and not {*self.inputs} & {*OF_A_POSE}
        return self.moves in OF_ONE_JOINT and 1 <= self.joint <= num_joints


@dataclass(frozen=True, eq=False)
class FittedTerm:
    """A term with the values ``(k,)`` of its parameters and their standard deviations ``(k,)``."""

    term: Term
    values: Array
    sigma: Array = field(default_factory=lambda: np.zeros(0))


class Cause:
    """Why a measured pose is not where the model has it, in plain words.

    Attributes:
        name: of the vocabulary in the design document.
        cause, remedy: one plain sentence each.
    """

    name: str
    cause: str
    remedy: str


class Effect(Cause, ABC):
    """A physical cause with its formula. One file each; ``effects.EFFECTS`` finds them.

    Attributes:
        needs: columns of the data that it cannot do without.
        plausible: its usual size, in words.
        shapes: what its terms may look like.
        driver: what makes it change: ``pose``, ``time`` or ``temperature``.
    """

    needs: ClassVar[tuple[str, ...]] = ()
    plausible: str
    shapes: ClassVar[tuple[Shape, ...]] = ()
    driver: ClassVar[str] = "pose"

    @abstractmethod
    def alternatives(self, robot: NominalRobot, context: Context) -> list[list[Term]]:
        """What poses can resolve of this effect: a list of forms that exclude each other, each a list of terms.

        An effect that depends on a number which does not enter linearly (a moment, a time constant) offers a form
        for each of a few values.
        """

    def refined(self, terms: list[Term], robot: NominalRobot, context: Context) -> list[list[Term]]:
        """Forms near a good one, to search more finely."""
        return []

    @abstractmethod
    def motion(self, term: Term, reading: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        """Size ``(c,)`` of the motion's components, linear in the parameters.

        ``reading`` holds a scalar for every input and every constant of the term.
        """

    def makes_sense(self, term: Term, values: Array) -> bool:
        """Whether values ``(k,)`` that a fit found are physically possible."""
        return True

    def terms(self, robot: NominalRobot, context: Context) -> list[Term]:
        """Its first form."""
        forms = self.alternatives(robot, context)
        return forms[0] if forms else []

    def missing(self, context: Context) -> tuple[str, ...]:
        """Needed columns that nobody recorded."""
        return tuple(name for name in self.needs if getattr(context, COLUMNS[name]) is None)


def basis(effect: Effect, term: Term, robot: NominalRobot, context: Context) -> Array:
    """``(N, c, k)`` derivative of the motion's components with respect to the parameters of a term."""
    if term.moves is Moves.BASE and any(getattr(context, name, 0) is None for name in term.inputs):
        return np.zeros((len(context), len(COMPONENTS[term.moves]), len(term.parameters)))  # its mean over the campaign
    inputs = readings(robot, context, term.inputs, term.joint, dict(term.constants))
    names = constant_names(term)
    values = [np.array([[term.constant(name)]]) for name in names]
    function = pose_function(effect, term)
    if not inputs:
        inputs = [np.zeros(len(context))]
    common = tuple(range(len(inputs), len(inputs) + len(values)))
    (jacobian,) = BatchedFunction(function, [*inputs, *values], common)()
    out = np.swapaxes(jacobian, 1, 2).copy()
    limits = fading_limits(term)
    if limits is not None:
        assert term.joint is not None
        out *= fade(context.q_rad[:, term.joint - 1], *limits)[:, None, None]
    return out


def constant_names(term: Term) -> tuple[str, ...]:
    """Of the constants that the motion depends on."""
    return tuple(name for name, _ in term.constants if not name.startswith("default "))


def fading_limits(term: Term) -> tuple[float, float] | None:
    """Angles of its joint, rad, beyond which a term fades to nothing; None if it never does."""
    constants = dict(term.constants)
    return (constants["lower_rad"], constants["upper_rad"]) if "lower_rad" in constants else None


def pose_function(effect: Effect, term: Term) -> ca.Function:
    """``basis_function`` of a term; terms that differ in the values of their constants only have it in common."""
    return basis_function(effect, replace(term, constants=tuple((name, 0.0) for name in constant_names(term))))


@lru_cache(maxsize=1024)
def basis_function(effect: Effect, term: Term) -> ca.Function:
    """CasADi function (inputs ..., constants ...) of one pose: derivative ``(c, k)``."""
    parameters = ca.SX.sym("parameters", len(term.parameters))
    inputs = [ca.SX.sym(name) for name in term.inputs]
    constants = [ca.SX.sym(name) for name, _ in term.constants]
    reading = dict(zip([*term.inputs, *(name for name, _ in term.constants)], [*inputs, *constants], strict=True))
    motion = effect.motion(term, reading, parameters)
    if motion.shape != (len(COMPONENTS[term.moves]), 1):
        raise TypeError(f"effect {effect.name} does not say how far each of {COMPONENTS[term.moves]} moves")
    jacobian = ca.jacobian(motion, parameters)
    if ca.depends_on(jacobian, parameters):
        raise TypeError(f"effect {effect.name} is not linear in its parameters")
    return ca.Function("derivative", [*(inputs or [ca.SX.sym("none")]), *constants], [ca.cse(ca.densify(jacobian))])


def probe_columns(term: Term, motion_basis: Array, chain: ChainPoses) -> Array:
    """``(N, 6, k)`` shift and turn of the probe per unit of each parameter of a term, for its basis ``(N, c, k)``."""
    return chain.displacement(term.moves, term.joint) @ motion_basis


def covered(context: Context, joint: int) -> tuple[tuple[str, float], ...]:
    """Constants that make a term fade beyond the angles at which its joint (from 1) was measured.

    Where next to nothing of a turn is missing, nothing lies beyond.
    """
    theta = context.q_rad[:, joint - 1]
    if np.ptp(theta) >= NEARLY_A_TURN_RAD:
        return ("lower_rad", -EVERYWHERE_RAD), ("upper_rad", EVERYWHERE_RAD)
    return ("lower_rad", float(theta.min())), ("upper_rad", float(theta.max()))
