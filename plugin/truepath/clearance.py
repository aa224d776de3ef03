"""How far the arm stays from itself and from its cell along a path, by Drake.

Which robot is looked at: the real one, as far as it is known. The cell's robot is given the calibrated joint frames,
base and tool mounting on Drake's context (``cell_geometry.place_robot``), and its joints take the angles that the
model's effects make of the commanded ones (``CalibratedModel.true_joints``). So the same cell answers both questions:
with the programmed joints, where the real robot goes today; with the corrected ones, where it will go. Networks, and
effects that tilt an axis or stretch the links, have no joint to act on and are left out: they are a small part of the
correction. With ``model.nominal_model(robot)`` the same class tells what the program means, in the cell as drawn.

How well that is known: over virtual UR5s that were measured with a reflector in stated frames, clearances of the tool
to 0.2 mm (rms; 1.3 mm in the cell as drawn), of the links to 0.6 mm or better (1.3 mm), because a calibration knows
the axis of a joint and not where along it the link sits. Without a stated place of the reflector the tool is known to
1 mm. How a correction changes a clearance is known to 0.02 mm (rms of changes of 0.9 mm).

Only the given joints are looked at, nothing between them: sample a path densely enough. Meshes count as their convex
hulls, as Drake takes them. Its distances between cylinders come out too large now and then: by 0.3 mm in one of a
hundred, by 2 mm in one of a thousand that are near.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from truepath.cell_geometry import GeometryPairs
from truepath.errors import InputError
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.posed_cell import CellOfAFile, Surroundings

RANGE_M = 0.011  # where a clearance starts to matter and by how much it may shrink, see ``closer``
SAME_M = 2e-6  # a distance that cannot have changed by more is not measured again
SAMPLED_POSTURES = 100
NUDGES_RAD = (0.0, 1e-7, -1e-6, 1e-5)
FAR_M, MANY = 0.05, 16  # from this many pairs on, Drake's broad phase is cheaper than one pair after the other


@dataclass(frozen=True, eq=False)
class Clearances:
    """Signed distances along N waypoints, negative for bodies that reach into each other.

    Attributes:
        bodies: P pairs of names, ``model::body``, that come within range somewhere.
        by_pair_m: ``(N, P)`` smallest distance of the shapes of two bodies; infinite beyond ``range_m``.
        range_m: up to where distances are told.
        measured: how many waypoints had to be asked of Drake; for the others certainty came from those before.
    """

    bodies: tuple[tuple[str, str], ...]
    by_pair_m: Array
    range_m: float
    measured: int

    @property
    def distance_m(self) -> Array:
        """``(N,)`` smallest of all pairs; infinite where nothing is within range."""
        return self.by_pair_m.min(axis=1, initial=np.inf)

    @property
    def nearest(self) -> list[tuple[str, str] | None]:
        """For each waypoint the two bodies that are closest; None where nothing is within range."""
        if not self.bodies:
            return [None] * len(self.by_pair_m)
        index = self.by_pair_m.argmin(axis=1)
        return [self.bodies[p] if near else None for p, near in zip(index, np.isfinite(self.distance_m), strict=True)]

    def of(self, bodies: tuple[str, str]) -> Array:
        """``(N,)`` distances of one pair."""
        if bodies not in self.bodies:
            return np.full(len(self.by_pair_m), np.inf)
        return self.by_pair_m[:, self.bodies.index(bodies)]


class Cell:
    """A cell in Drake in which a calibrated robot stands and moves.

    Args:
        cell: built-in name, URDF or directives, of a built-in robot the cell that comes with it; or ``Surroundings``.
        model: the calibrated robot, or ``nominal_model(robot)`` for the drawing.

    Raises:
        InputError: no such cell, the arm in it is not the calibrated one, or it has no shapes that can collide.
    """

    def __init__(self, cell: str | Path | Surroundings, model: CalibratedModel) -> None:
        surroundings = CellOfAFile(cell) if isinstance(cell, (str, Path)) else cell
        self.model, self._posed = model, surroundings.with_robot(model)
        posed = self._posed
        self._positions = posed.plant.GetPositions(posed.context)
        self._of_arm = [joint.position_start() for joint in posed.arm.joints]
        self._file = surroundings.file
        pairs = GeometryPairs.of(posed.plant, posed.inspector, posed.context, posed.arm)
        if not pairs.ids:
            raise InputError(
                "nothing in this cell can collide",
                file=self._file,
                expected="collision geometry on the robot and around it",
            )
        self._pairs = self._without_what_always_touches(pairs)
        self._index = _index(self._pairs)

    @property
    def body_pairs(self) -> tuple[tuple[str, str], ...]:
        """Names, ``model::body``, of all bodies that are watched for coming together."""
        return tuple(self._pairs.bodies[p] for p in np.unique(self._pairs.body_pair))

    def is_free(self, q_rad: Array) -> bool:
        """Whether the arm at commanded joints ``(n,)`` touches neither itself nor the cell."""
        return not self.clearances(np.atleast_2d(q_rad), range_m=0.0).by_pair_m.size

    @property
    def default_joints(self) -> Array:
        """``(n,)`` the posture in which the model stands by default, rad."""
        return self._posed.plant.GetDefaultPositions()[self._of_arm]

    def query_at(self, q_rad: Array) -> Any:
        """Drake's query object for the arm at commanded joints ``(n,)``; valid until the next question."""
        return self._at(self.model.true_joints(np.atleast_2d(q_rad))[0])

    def collides(self, q_rad: Array) -> Array:
        """``(N,)`` whether the arm at commanded joints ``(N, n)`` touches itself or the cell.

        Ten times as fast as to ask for distances, for whoever has thousands of unrelated postures.
        """
        phi = self.model.true_joints(np.asarray(q_rad, float))
        return np.array([self._asked(angles, self._touching) for angles in phi], bool).reshape(len(phi))

    def _touching(self, query: Any) -> bool:
        if not query.HasCollisions():
            return False
        return any(_key(pair.id_A, pair.id_B) in self._index for pair in query.ComputePointPairPenetration())

    def clearances(self, q_rad: Array, range_m: float = RANGE_M) -> Clearances:
        """Distances along commanded joints ``(N, n)``.

        A pair that was d apart is further apart than the range for as long as the joints have not turned enough to
        bring it there, which no geometry needs to be asked for: see ``GeometryPairs.reach_m``. What comes within range
        is measured, to ``SAME_M``.
        """
        phi = self.model.true_joints(np.asarray(q_rad, float))
        found = _Found(range_m)
        known = np.full(len(self._pairs.ids), -np.inf)  # distance at the joints ``at``, or a lower bound of it
        at = np.zeros_like(self._pairs.reach_m)
        measured = 0
        for k, angles in enumerate(phi):  # Drake answers one context at a time
            change = np.einsum("gn,gn->g", np.abs(angles - at), self._pairs.reach_m)
            near = np.flatnonzero(known - change <= range_m)
            if not len(near):
                continue
            stale = near[(change[near] > SAME_M) | np.isinf(known[near])]
            if len(stale):
                measured += 1
                self._measure(angles, stale, FAR_M + range_m, known, at)
                near = np.flatnonzero(known <= range_m) if len(stale) >= MANY else near[known[near] <= range_m]
            found.add(k, self._pairs.body_pair[near], known[near])
        return found.clearances(self._pairs.bodies, len(phi), measured)

    def _measure(self, angles: Array, stale: Array, far_m: float, known: Array, at: Array) -> None:
        """Renews the distances of pairs that are stale, or of all if they are many; those beyond ``far_m`` get that."""
        if len(stale) < MANY:
            known[stale] = self._asked(angles, lambda query: [self._distance(query, g) for g in stale])
            at[stale] = angles
            return
        near = self._asked(angles, lambda query: self._nearby(query, far_m))
        known[:], at[:] = far_m, angles
        for g, distance in near:
            known[g] = distance

    def _asked(self, phi: Array, question: Callable[[Any], Any]) -> Any:
        """An answer of Drake's for the true angles ``(n,)``; rarely it finds one only a hair beside them."""
        problem = ""
        for nudge in NUDGES_RAD:
            try:
                return question(self._at(phi + nudge))
            except RuntimeError as error:
                problem = str(error)
        raise InputError("Drake cannot tell a distance in this cell", file=self._file, found=problem[:300])

    def _distance(self, query: Any, g: int) -> float:
        return float(query.ComputeSignedDistancePairClosestPoints(*self._pairs.ids[g]).distance)

    def _at(self, phi: Array) -> Any:
        """Drake's query object for the true angles ``(n,)``."""
        self._positions[self._of_arm] = phi
        self._posed.plant.SetPositions(self._posed.context, self._positions)
        return self._posed.query()

    def _nearby(self, query: Any, distance_m: float) -> list[tuple[int, float]]:
        """All watched pairs up to a distance apart."""
        near = query.ComputeSignedDistancePairwiseClosestPoints(distance_m)
        found = [(self._index.get(_key(pair.id_A, pair.id_B)), pair.distance) for pair in near]
        return [(g, distance) for g, distance in found if g is not None]

    def _without_what_always_touches(self, pairs: GeometryPairs) -> GeometryPairs:
        """Leaves out shapes that overlap by design, such as a housing in the pedestal that it turns on.

        Drake filters neighbours in the chain itself. What touches at every one of many random postures, too, is how
        the cell is drawn, and no collision.
        """
        robot = self.model.robot
        lower, upper = np.maximum(robot.lower_rad, -np.pi), np.minimum(robot.upper_rad, np.pi)
        postures = np.random.default_rng(0).uniform(lower, upper, (SAMPLED_POSTURES, robot.num_joints))
        self._pairs, self._index = pairs, _index(pairs)
        touches = np.zeros(len(pairs.ids), int)
        for phi in postures:
            for g, distance in self._asked(phi, lambda query: self._nearby(query, 0.0)):
                touches[g] += distance <= 0.0
        return pairs.subset(np.flatnonzero(touches < SAMPLED_POSTURES))


class _Found:
    """Collects what came within range."""

    def __init__(self, range_m: float) -> None:
        self.range_m = range_m
        self._entries: list[tuple[int, int, float]] = []

    def add(self, waypoint: int, body_pair: Array, distance_m: Array) -> None:
        self._entries.extend((waypoint, p, d) for p, d in zip(body_pair.tolist(), distance_m.tolist(), strict=True))

    def clearances(self, bodies: tuple[tuple[str, str], ...], count: int, measured: int) -> Clearances:
        entries = np.array(self._entries, float).reshape(-1, 3)
        pairs, column = np.unique(entries[:, 1].astype(int), return_inverse=True)
        by_pair = np.full((count, len(pairs)), np.inf)
        np.minimum.at(by_pair, (entries[:, 0].astype(int), column), entries[:, 2])
        return Clearances(tuple(bodies[p] for p in pairs), by_pair, self.range_m, measured)


def _index(pairs: GeometryPairs) -> dict[tuple[int, int], int]:
    return {_key(*ids): g for g, ids in enumerate(pairs.ids)}


def _key(a: Any, b: Any) -> tuple[int, int]:
    one, other = a.get_value(), b.get_value()
    return (one, other) if one < other else (other, one)
