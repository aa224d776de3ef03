"""Ways from pose to pose around the cell: straight in the joints where that is free, else over points of a roadmap.

A lazy probabilistic roadmap (Bohlin, Kavraki 2000): the shortest way over points that are known to be free is looked
for first, and only its pieces are tested; a piece that is not free is struck out and the next shortest way is tried.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array
from truepath.planning.free_space import FreeSpace
from truepath.planning.roadmap import Roadmap

NEIGHBOURS = 16  # of each point on the roadmap, and of each pose to be put in order
MOST_TRIES = 400  # ways that may turn out to be blocked
BLOCKED_LONGER, BLOCKED_RAD = 1.5, 0.5  # guess of a way around, for the order: so much longer, and so much on top


@dataclass(frozen=True, eq=False)
class Ways:
    """Ways between any two of some poses.

    Attributes:
        space: the cell; None: every straight way is free.
        roadmap: postures that a detour may lead over; None where there is no cell.
    """

    space: FreeSpace | None = None
    roadmap: Roadmap | None = None

    def lengths(self, q_rad: Array) -> Array:
        """``(N, N)`` how far the fastest joint turns between poses ``(N, n)``, rad; a guess where a way is blocked.

        Only ways between near poses are looked at: an order that is any good takes few others.
        """
        length = np.abs(q_rad[:, None] - q_rad).max(axis=2)
        if self.space is None:
            return length
        near = np.argsort(length, axis=1)[:, 1 : NEIGHBOURS + 1]
        guess = length * 1.2
        for k, row in enumerate(near):
            for other in row[(row > k) | ~(near[row] == k).any(axis=1)]:
                free = self.space.seems_free(q_rad[k], q_rad[other])
                way = length[k, other]
                guess[k, other] = guess[other, k] = way if free else BLOCKED_LONGER * way + BLOCKED_RAD
        return guess

    def between(self, start: Array, end: Array) -> Array:
        """``(k, n)`` points to pass on the way from ``(n,)`` to ``(n,)``; none where the straight way is free.

        Raises:
            InputError: no way was found.
        """
        if self.space is None or self.space.way_is_free(start, end):
            return np.zeros((0, len(start)))
        assert self.roadmap is not None
        nodes = np.vstack([self.roadmap.nodes, start, end])
        count = len(nodes)
        length = np.abs(nodes[:, None] - nodes).max(axis=2)
        near = [set(row[1 : NEIGHBOURS + 1].tolist()) for row in np.argsort(length, axis=1)]
        for a, b in [*self.roadmap.edges, *((k, other) for k, row in enumerate(near) for other in row)]:
            near[a].add(b)
            near[b].add(a)
        near[count - 2].discard(count - 1)
        near[count - 1].discard(count - 2)
        for _ in range(MOST_TRIES):
            path = _shortest(near, length, count - 2, count - 1)
            if not path:
                break
            blocked = next(self._blocked(nodes, path), None)
            if blocked is None:
                return nodes[self._shortcut(nodes, path)][1:-1]
            a, b = blocked
            near[a].discard(b)
            near[b].discard(a)
        raise InputError(
            "no way free of collision was found between two of the poses",
            expected="more room in the cell",
            found="from " + _degrees(start) + " to " + _degrees(end) + " degrees",
        )

    def _blocked(self, nodes: Array, path: list[int]) -> Iterator[tuple[int, int]]:
        assert self.space is not None
        pieces = list(pairwise(path))
        for test in (self.space.seems_free, self.space.way_is_free):  # quick looks at all pieces first
            for a, b in pieces:
                if not test(nodes[a], nodes[b]):
                    yield a, b

    def _shortcut(self, nodes: Array, path: list[int]) -> list[int]:
        """Without the points that need not be passed."""
        assert self.space is not None
        short, k = [path[0]], 0
        while k < len(path) - 1:
            further = range(len(path) - 1, k, -1)
            k = next(m for m in further if m == k + 1 or self.space.way_is_free(nodes[path[k]], nodes[path[m]]))
            short.append(path[k])
        return short


def _shortest(near: list[set[int]], length: Array, start: int, end: int) -> list[int]:
    """Points of the shortest way (A*, the straight way being the estimate); empty where there is none."""
    best, came = {start: 0.0}, {start: start}
    queue = [(float(length[start, end]), start)]
    done: set[int] = set()
    while queue:
        _, here = heapq.heappop(queue)
        if here == end:
            path = [end]
            while path[-1] != start:
                path.append(came[path[-1]])
            return path[::-1]
        if here in done:
            continue
        done.add(here)
        for other in sorted(near[here]):
            way = best[here] + float(length[here, other])
            if way < best.get(other, np.inf):
                best[other], came[other] = way, here
                heapq.heappush(queue, (way + float(length[other, end]), other))
    return []


def _degrees(q_rad: Array) -> str:
    return "(" + ", ".join(f"{angle:.1f}" for angle in np.degrees(q_rad)) + ")"
