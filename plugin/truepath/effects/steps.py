"""What causes that jump at one moment have in common: the moment is searched, coarsely and then finely."""

from __future__ import annotations

import numpy as np

from truepath.context import Context
from truepath.effects.base import Term
from truepath.lie import Array

COARSE_STEPS = 48
LEAST_ROWS = 4  # on either side of a step


def clock_of(context: Context) -> Array:
    """``(N,)`` the time of each pose: recorded, or else its place in the order of measurement."""
    values = getattr(context, context.clock)
    return np.arange(len(context), dtype=float) if values is None else values


def moments(context: Context) -> Array:
    """Possible moments of a step: between any two poses, some away from both ends."""
    times = np.unique(clock_of(context))
    between = 0.5 * (times[1:] + times[:-1])
    return between[LEAST_ROWS - 1 : len(between) - LEAST_ROWS + 1]


def coarse(candidates: Array, count: int = COARSE_STEPS) -> Array:
    """A few of them, evenly spread."""
    if len(candidates) <= count:
        return candidates
    return candidates[np.unique(np.linspace(0, len(candidates) - 1, count).astype(int))]


def near(term: Term, context: Context) -> Array:
    """Candidates between the coarse neighbours of the moment of a term."""
    every = moments(context)
    picked = coarse(every)
    at = term.constant("moment")
    below, above = picked[picked < at], picked[picked > at]
    first = below[-1] if len(below) else -np.inf
    last = above[0] if len(above) else np.inf
    return coarse(every[(every > first) & (every < last)], 2 * COARSE_STEPS)
