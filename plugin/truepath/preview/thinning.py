"""Level of detail: which few of many points give the same line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truepath.lie import Array

WORST_FIRST = 0.5
LINE_LIMIT = 2_000  # points per line; more cannot be told apart on a screen


def thin_out(
    points: Array, limit: int = LINE_LIMIT, tolerance: float = 0.0, at: Array | None = None
) -> NDArray[np.int64]:
    """Indices of at most ``limit`` of the points whose line looks like the line through all of them.

    Both ends are kept, then, wherever the line of those kept is off by more than the tolerance, the point that is
    furthest off (Douglas, Peucker 1973, several pieces at once). So corners and the worst points stay.

    Args:
        points: ``(K, d)`` in a space where distances mean something: colours or angles may be among the coordinates.
        tolerance: how far the line of those kept may be off.
        at: ``(K,)`` increasing, when the points are passed: then a point must be reached in time, not just be on the
            line. None: only the line counts.
    """
    K = len(points)
    if K <= 2:
        return np.arange(K)
    kept = np.zeros(K, bool)
    kept[[0, -1]] = True
    while True:
        ends = np.flatnonzero(kept)
        piece = np.repeat(np.arange(len(ends) - 1), np.diff(ends))
        piece = np.append(piece, len(ends) - 2)
        off = _off(points, ends[piece], ends[piece + 1], at)
        off[kept] = -1.0
        by_piece = np.lexsort((off, piece))
        furthest = by_piece[np.append(np.flatnonzero(np.diff(piece[by_piece])), K - 1)]
        # The worst first, else the limit is spent on small bends before a large one has its turn.
        furthest = furthest[off[furthest] > max(tolerance, WORST_FIRST * float(off.max()))]
        room = limit - len(ends)
        if not len(furthest) or room <= 0:
            return ends
        kept[furthest[np.argsort(-off[furthest], kind="stable")[:room]]] = True


def _off(points: Array, start: Array, end: Array, at: Array | None) -> Array:
    """``(K,)`` distances of the points from the pieces between those with indices start and end ``(K,)``."""
    a, chord = points[start], points[end] - points[start]
    if at is None:
        share = np.einsum("ki,ki->k", points - a, chord) / np.maximum(np.einsum("ki,ki->k", chord, chord), 1e-30)
    else:
        share = (at - at[start]) / np.maximum(at[end] - at[start], 1e-30)
    return np.linalg.norm(points - a - np.clip(share, 0.0, 1.0)[:, None] * chord, axis=1)
