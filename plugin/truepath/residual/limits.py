"""The settings of evolution and training, and when networks count as proved.

They know nothing of torch, so that a command line can have them at once.
"""

from __future__ import annotations

from dataclasses import dataclass

from truepath.errors import InputError

SIGNIFICANT = 0.01  # p value of there being no gain


@dataclass(frozen=True)
class Settings:
    """How to evolve.

    Attributes:
        individuals: networks in the population.
        smallest, largest: hidden neurons.
        generations: at most.
        stagnation: generations after which it ends if the best error fell by less than a thousandth in them.
        target: mean squared error (of scaled outputs) at which it ends.
        sizes_every: generations between two steps of the hidden sizes (eq. 22), while the target is not met.
        factor: of the difference of two individuals in a mutation (eq. 19).
        crossover: share of mutated numbers in a trial (eq. 20).
    """

    individuals: int = 60
    smallest: int = 10
    largest: int = 30
    generations: int = 150
    stagnation: int = 40
    target: float = 0.0
    sizes_every: int = 10
    factor: float = 0.5
    crossover: float = 0.9

    def __post_init__(self) -> None:
        if self.individuals < 3:
            raise InputError("a mutation takes the best and two others", expected="3 individuals or more")
        if not 1 <= self.smallest <= self.largest:
            raise InputError("these are no hidden sizes", expected="1 <= smallest <= largest")
        if min(self.generations, self.stagnation, self.sizes_every) < 1:
            raise InputError("an evolution takes generations", expected="1 or more")


@dataclass(frozen=True)
class Limits:
    """When gradient training ends: after so many iterations, or so many without a lower error on the validation."""

    iterations: int = 200
    patience: int = 30
