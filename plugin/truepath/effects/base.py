"""What an effect is: a physical cause that turns a joint a little from where its encoder says.

phi_i = theta_i + sum over effects of delta_phi_i(theta, context), and the parameters enter linearly.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import casadi as ca
import numpy as np

from truepath.batched import BatchedFunction
from truepath.lie import Array
from truepath.robot import NominalRobot

FADE_RAD = np.radians(10.0)


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
    """One effect on one joint (counted from 1), as far as a data set can resolve it.

    Attributes:
        effect: name of the effect.
        joint: number of the joint.
        lower_rad, upper_rad: angles that the data covered; beyond them the term fades to nothing.
        parameters: what is to be found.
    """

    effect: str
    joint: int
    lower_rad: float
    upper_rad: float
    parameters: tuple[EffectParameter, ...]


@dataclass(frozen=True, eq=False)
class FittedTerm:
    """A term with the values ``(k,)`` of its parameters and their standard deviations ``(k,)``."""

    term: Term
    values: Array
    sigma: Array = field(default_factory=lambda: np.zeros(0))


class Effect(ABC):
    """A physical cause. One file each; ``effects.EFFECTS`` finds them.

    Attributes:
        name: of the vocabulary in the design document.
        needs: context that the effect cannot do without, by name: ``gravity_torque``, ...
        cause, remedy: one plain sentence each.
    """

    name: str
    needs: tuple[str, ...] = ()
    cause: str
    remedy: str

    @abstractmethod
    def terms(self, robot: NominalRobot, q_rad: Array) -> list[Term]:
        """What poses ``(N, n)`` can resolve of this effect, joint by joint."""

    @abstractmethod
    def joint_error(self, term: Term, theta: ca.SX, context: Mapping[str, ca.SX], parameters: ca.SX) -> ca.SX:
        """delta_phi in rad of the term's joint: linear in the parameters ``(k,)``; theta and context are scalars."""


def basis(effect: Effect, term: Term, q_rad: Array, context: Mapping[str, Array]) -> Array:
    """``(N, k)`` derivative of the joint's error, rad, with respect to the parameters of a term.

    Args:
        effect: whose term it is.
        term: which joint, which parameters.
        q_rad: ``(N, n)`` commanded joints.
        context: ``(N, n)`` arrays by name.
    """
    joint = term.joint - 1
    theta = q_rad[:, joint]
    inputs = [theta, *(context[name][:, joint] for name in effect.needs)]
    (jacobian,) = BatchedFunction(basis_function(effect, term), inputs)()
    return jacobian[:, :, 0] * fade(theta, term.lower_rad, term.upper_rad)[:, None]


@lru_cache(maxsize=256)
def basis_function(effect: Effect, term: Term) -> ca.Function:
    """CasADi function (theta, context ...) of one pose: derivative ``(1, k)`` of the error by the parameters."""
    theta, parameters = ca.SX.sym("theta"), ca.SX.sym("parameters", len(term.parameters))
    context = {name: ca.SX.sym(name) for name in effect.needs}
    jacobian = ca.jacobian(effect.joint_error(term, theta, context, parameters), parameters)
    if ca.depends_on(jacobian, parameters):
        raise TypeError(f"effect {effect.name} is not linear in its parameters")
    return ca.Function("derivative", [theta, *context.values()], [ca.cse(ca.densify(jacobian))])


def fade(theta: Array, lower_rad: float, upper_rad: float) -> Array:
    """``(N,)`` 1 within the limits, 0 beyond ten degrees outside, smooth between (quintic, C2)."""
    beyond = np.maximum(lower_rad - theta, theta - upper_rad)
    t = np.clip(1.0 - beyond / FADE_RAD, 0.0, 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
