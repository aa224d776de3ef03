"""The paper's own use of the network: from joint angles straight to the position, without any kinematics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from truepath.lie import Array
from truepath.residual.learning import Lesson, learn_network
from truepath.residual.limits import Limits, Settings
from truepath.residual.network import Network, one_thread
from truepath.residual.options import Options

VALIDATION_SHARE = 0.1
LEAST_HALF_RANGE = 1e-9
PAPER = Settings(individuals=100, smallest=40, largest=60, generations=300, stagnation=60)
LONG = Limits(iterations=500, patience=100)


@dataclass(frozen=True, eq=False)
class DirectNetwork:
    """A network from joints to positions, with the scaling of both.

    Attributes:
        network: from joints in -1 to 1 to positions in units of ``scale_m``.
        middle_rad, half_range_rad: ``(n,)`` of the joints it learnt from.
        centre_m: ``(3,)``; scale_m: ``(3,)``, of the positions.
    """

    network: Network
    middle_rad: Array
    half_range_rad: Array
    centre_m: Array
    scale_m: Array

    @property
    def hidden(self) -> int:
        """Number of hidden neurons."""
        return self.network.neurons

    def predict(self, q_rad: Array) -> Array:
        """``(N, 3)`` positions, m, in the frame of those that it learnt from, for joints ``(N, n)``."""
        with one_thread():
            return self.network((q_rad - self.middle_rad) / self.half_range_rad) * self.scale_m + self.centre_m


def learn_direct(
    q_rad: Array,
    p_m: Array,
    seed: int = 0,
    *,
    options: Options | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> DirectNetwork:
    """Evolves and trains a network that predicts positions, as the paper describes it.

    Args:
        q_rad: ``(N, n)`` commanded joints.
        p_m: ``(N, 3)`` measured positions, m, in any frame.
        seed: of the evolution and of the choice of the validation part.
        options: of the evolution and the training.
        progress: told in plain words what is being done.
    """
    options = options or Options(evolution=PAPER, limits=LONG)
    lower, upper = q_rad.min(axis=0), q_rad.max(axis=0)
    middle, half = 0.5 * (lower + upper), np.maximum(0.5 * (upper - lower), LEAST_HALF_RANGE)
    # One scale for all three: the paper's error (eq. 15) is a length.
    centre = p_m.mean(axis=0)
    scale = np.full(3, max(float((p_m - centre).std()), LEAST_HALF_RANGE))
    validation = np.random.default_rng(seed).permutation(len(q_rad)) < VALIDATION_SHARE * len(q_rad)
    lesson = Lesson((q_rad - middle) / half, (p_m - centre) / scale, validation, seed)
    network = learn_network(lesson, options, lambda s: progress(f"generation {s.generation}"))
    return DirectNetwork(network, middle, half, centre, scale)
