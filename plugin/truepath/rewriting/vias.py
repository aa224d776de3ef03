"""Targets to be added on the way, so that the real tool stays on the path between corrected targets too.

The controller goes from one commanded tool pose to the next along a straight line or an arc. Where the commanded poses
that the points between need are off that line, the real tool will be off the path by as much (to a few parts in a
thousand, for the real robot differs from the controller's by so little).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truepath.lie import Array
from truepath.programs.motions import Motions
from truepath.rewriting.arcs import circle_through
from truepath.rewriting.plan import Plan, with_tool_of
from truepath.rewriting.ways import ARC_STEPS, Ways

PARTS_OF_AN_ARC = (1, 2, 3, 4, 6, 8, 12)
LARGEST_BLEND_M, BLEND_SHARE = 0.010, 0.3  # of the shorter one of the two ways that a blend joins


@dataclass(frozen=True)
class Via:
    """A target on the way.

    Attributes:
        target: index in the plan of the target at the end of the way.
        samples: of the way: where it is; for an arc the point that it passes, and where it ends.
        blend_m: radius around it.
        share: of the way that ends here.
    """

    target: int
    samples: tuple[int, ...]
    blend_m: float
    share: float


@dataclass(frozen=True, eq=False)
class Vias:
    """What is added.

    Attributes:
        added: in the order of the path.
        through: for arcs that were divided: per index of the point that the last part passes, the sample for it.
        before_mm, after_mm: ``(W,)`` largest distance from the path on each way, without and with what was added.
    """

    added: list[Via]
    through: dict[int, int]
    before_mm: Array
    after_mm: Array


def choose_vias(
    plan: Plan, ways: Ways, X_end: Array, tolerance_mm: float | None, may_add: Callable[[int], bool]
) -> Vias:
    """As few targets as keep every way within the tolerance.

    Args:
        plan, ways: with what the controller must believe on the way.
        X_end: ``(N, 4, 4)`` the same at the targets.
        tolerance_mm: None to add nothing and only tell how far off the ways are.
        may_add: whether a line can be added before a target of the plan.
    """
    X_begin = with_tool_of(plan.motions, X_end, ways.start, ways.target)
    before = off_the_line(ways, X_begin, X_end)
    after = before.copy()
    added: list[Via] = []
    through: dict[int, int] = {}
    for way, arc in ways.arcs.items():
        if not ways.followed[way]:
            continue
        points = _points(ways, X_begin, X_end, way)
        middle = X_end[arc.through, :3, 3]
        before[way] = after[way] = _off_an_arc(points, middle)
        if tolerance_mm is None or before[way] <= tolerance_mm or not may_add(int(ways.target[way])):
            continue
        rounding = max(_rounding(plan.motions, ways, way))
        parts, off = _divided(points, tolerance_mm, arc.length_m, rounding)
        if off >= before[way]:  # no better than as it was
            continue
        after[way] = off
        # Where a blend leaves an arc, it cuts off r^2 / 4 R at most: of the tolerance no more than a quarter.
        blend = min(_blend(arc.length_m / parts - rounding), (arc.circle.radius_m * 1e-3 * tolerance_mm) ** 0.5)
        _add_arcs(ways, way, arc.through, parts, _whole(blend), added, through)
    if tolerance_mm is not None:
        for way in np.flatnonzero(before > tolerance_mm).tolist():
            if way not in ways.arcs and may_add(int(ways.target[way])):
                after[way] = _add_to_line(
                    plan.motions, ways, _points(ways, X_begin, X_end, way), way, tolerance_mm, added
                )
    added.sort(key=lambda via: (via.target, via.samples))
    return Vias(added, through, before, after)


def _points(ways: Ways, X_begin: Array, X_end: Array, way: int) -> Array:
    """``(K + 2, 3)`` commanded positions along a way, ends included."""
    inner = ways.X_CT_commanded[ways.samples(way), :3, 3]
    return np.concatenate([X_begin[way, None, :3, 3], inner, X_end[ways.target[way], None, :3, 3]])


def off_the_line(ways: Ways, X_begin: Array, X_end: Array) -> Array:
    """``(W,)`` largest distance of the commanded positions from the straight line between the ends, mm."""
    way = np.repeat(np.arange(len(ways.target)), np.diff(ways.first))
    start, end = X_begin[:, :3, 3], X_end[ways.target, :3, 3]
    off = _from_line(ways.X_CT_commanded[:, :3, 3], start[way], end[way])
    largest = np.zeros(len(ways.target))
    np.maximum.at(largest, way, 1e3 * off)
    return np.where(ways.followed, largest, 0.0)


def _from_line(points: Array, start: Array, end: Array) -> Array:
    """``(K,)`` distances of points ``(K, 3)`` from lines between ``(K, 3)``; from the start where there is no line."""
    along = end - start
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    unit = np.divide(along, length, out=np.zeros_like(along), where=length > 1e-9)
    away = points - start
    return np.linalg.norm(away - np.sum(away * unit, axis=-1, keepdims=True) * unit, axis=-1)


def _off_an_arc(points: Array, middle: Array) -> float:
    circle = circle_through(points[0], middle, points[-1])
    return np.inf if circle is None else 1e3 * float(circle.distance(points).max())


def _rounding(motions: Motions, ways: Ways, way: int) -> tuple[float, float]:
    """Radii of the blends that the program states at the start and the end of a way, m."""
    start, end = (float(np.nan_to_num(motions.blend_m[at])) for at in (ways.start[way], ways.target[way]))
    return start, end


def _divided(points: Array, tolerance_mm: float, length_m: float, rounding_m: float) -> tuple[int, float]:
    """Into how many arcs, and how far they are off; the best there is where none is good enough.

    No part is so short that the blends at the ends of the whole arc fill it.
    """
    best = (1, np.inf)
    for parts in PARTS_OF_AN_ARC:
        if parts > 1 and length_m / parts <= rounding_m / (1 - BLEND_SHARE):
            break
        step = ARC_STEPS // parts
        pieces = [points[k : k + step + 1] for k in range(0, ARC_STEPS, step)]
        off = max(_off_an_arc(piece, piece[step // 2]) for piece in pieces)
        if off < best[1]:
            best = (parts, off)
        if off <= tolerance_mm:
            break
    return best


def _add_arcs(
    ways: Ways, way: int, middle: int, parts: int, blend_m: float, added: list[Via], through: dict[int, int]
) -> None:
    step, first = ARC_STEPS // parts, int(ways.first[way])
    target = int(ways.target[way])
    for part in range(1, parts):
        end = part * step  # counted in points, the first of which is the start
        added.append(Via(target, (first + end - step // 2 - 1, first + end - 1), blend_m, 1.0 / parts))
    through[middle] = first + ARC_STEPS - step // 2 - 1


def _blend(length_m: float) -> float:
    """Radius for a way of which this much is left."""
    return _whole(min(BLEND_SHARE * length_m, LARGEST_BLEND_M))


def _whole(radius_m: float) -> float:
    """In whole hundredths of a millimetre."""
    return float(np.floor(1e5 * radius_m) / 1e5)


def _add_to_line(motions: Motions, ways: Ways, points: Array, way: int, tolerance_mm: float, added: list[Via]) -> float:
    """Adds what one line through points ``(K, 3)`` needs; how far it is off then, mm."""
    target, length = int(ways.target[way]), float(ways.length_m[way])
    share = np.concatenate([[0.0], ways.share[ways.samples(way)], [1.0]])
    # Blends of the ends must not meet those of what is added, else a controller leaves one of them out.
    rounding = _rounding(motions, ways, way)
    room = _blend(length)
    usable = (share * length > rounding[0] + room) & ((1 - share) * length > rounding[1] + room)
    usable[[0, -1]] = True
    chosen = [0]
    while chosen[-1] != len(points) - 1:
        here = chosen[-1]
        candidates = np.flatnonzero(usable[here + 1 :]) + here + 1
        reach = [k for k in candidates.tolist() if _piece_off(points, here, k) <= tolerance_mm]
        chosen.append(max(reach) if reach else int(candidates[0]))
    gaps = np.diff(share[chosen]) * length
    gaps[0] -= rounding[0]
    gaps[-1] -= rounding[1]
    first = int(ways.first[way])
    for k in range(1, len(chosen) - 1):
        blend = _blend(float(min(gaps[k - 1], gaps[k])))
        added.append(Via(target, (first + chosen[k] - 1,), blend, float(share[chosen[k]] - share[chosen[k - 1]])))
    return max(_piece_off(points, *piece) for piece in pairwise(chosen))


def _piece_off(points: Array, here: int, there: int) -> float:
    if there - here < 2:
        return 0.0
    inner = points[here + 1 : there]
    return 1e3 * float(_from_line(inner, points[here], points[there]).max())
