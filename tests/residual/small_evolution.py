"""Something quick to evolve, and to evolve towards."""

import numpy as np
import torch
from by_loop import random_network
from truepath.residual.limits import Settings
from truepath.residual.population import Population

SMALL = Settings(individuals=12, smallest=2, largest=9, generations=25, sizes_every=5)


def population_of(sizes, seed=0, room=9, dtype=torch.float64):
    """Random networks of three inputs and two outputs."""
    rng = np.random.default_rng(seed)
    return Population.of([random_network(rng, 3, size, 2) for size in sizes], room, torch.device("cpu"), dtype)
