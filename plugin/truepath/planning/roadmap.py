"""Which postures the arm can reach from where it stands, without passing through the cell, itself or a joint limit."""

from __future__ import annotations

import numpy as np

from truepath.lie import Array
from truepath.planning.free_space import FreeSpace

NODES, TRIES = 150, 8


class Roadmap:
    """Free postures that are connected with each other, grown from home (Kavraki et al. 1996).

    Args:
        space: the cell.
        home: ``(n,)`` a free posture.
        postures: ``(P, n)`` free postures to take in, in this order.

    Attributes:
        nodes: ``(N, n)`` those that are connected, home first.
        edges: pairs of their numbers between which a straight way was found.
    """

    def __init__(self, space: FreeSpace, home: Array, postures: Array) -> None:
        self._space = space
        self.nodes, self.edges = home[None], list[tuple[int, int]]()
        left = [*postures[:NODES]]
        while left:  # what cannot be taken in now may be later, when there are more to start from
            refused = []
            for q in left:
                node = self._first_to(q)
                if node is None:
                    refused.append(q)
                    continue
                self.edges.append((node, len(self.nodes)))
                self.nodes = np.vstack([self.nodes, q])
            if len(refused) == len(left):
                break
            left = refused

    def reaches(self, q_rad: Array) -> Array:
        """``(N,)`` which of the free postures ``(N, n)`` can be reached, as far as a quick look tells."""
        return np.array([self._first_to(q) is not None for q in q_rad], bool)

    def _first_to(self, q: Array) -> int | None:
        """The nearest node from which a straight way leads to ``(n,)``; None if there is none among the next few."""
        near = np.argsort(np.abs(self.nodes - q).max(axis=1), kind="stable")[:TRIES]
        return next((int(node) for node in near if self._space.seems_free(self.nodes[node], q)), None)
