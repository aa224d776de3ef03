"""The targets of a program as a tree: each with the one before it, joints known at some of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order

from truepath.errors import InputError
from truepath.lie import Array
from truepath.model import nominal_flange_poses
from truepath.robot import NominalRobot

CHUNK = 1024


@dataclass(frozen=True, eq=False)
class Targets:
    """N targets, and behind them the start if it is known: M in all.

    Attributes:
        X: ``(M, 4, 4)`` flange poses; where joints are given, those of the joints if a pose follows.
        q_rad, q_near_rad: ``(M, n)``, NaN where not stated.
        parent: ``(M,)`` the target before it; -1 where nobody knows, and where it does not matter.
        order: targets such that each comes after its parent; those that run in circles are not among them.
        is_straight: ``(M,)``.
    """

    X: Array
    q_rad: Array
    q_near_rad: Array
    parent: Array
    order: Array
    is_straight: Array

    @property
    def is_pose(self) -> Array:
        return np.isnan(self.q_rad[:, 0])

    @property
    def is_near_stated(self) -> Array:
        return self.is_pose & ~np.isnan(self.q_near_rad[:, 0])

    @property
    def follows(self) -> Array:
        """``(M,)`` poses whose posture is a matter of the target before them, which there is."""
        return self.is_pose & (self.parent >= 0)

    @classmethod
    def of(
        cls,
        robot: NominalRobot,
        X: Array,
        q_rad: Array,
        q_near_rad: Array,
        previous: Array,
        q_start: Array | None,
        is_straight: Array | None,
    ) -> Targets:
        """Raises InputError as ``follow_targets`` says; takes copies."""
        count, n = len(X), robot.num_joints
        is_straight = np.zeros(count, bool) if is_straight is None else np.asarray(is_straight, bool)
        shapes = {
            "X": (X.shape, (count, 4, 4)),
            "q_rad": (q_rad.shape, (count, n)),
            "q_near_rad": (q_near_rad.shape, (count, n)),
            "previous": (previous.shape, (count,)),
            "is_straight": (is_straight.shape, (count,)),
            "q_start": ((n,) if q_start is None else np.shape(q_start), (n,)),
        }
        for name, (found, expected) in shapes.items():
            if found != expected:
                raise InputError("wrong shape", column=name, expected=str(expected), found=str(found))
        for name, joints in (("q_rad", q_rad), ("q_near_rad", q_near_rad)):
            unknown = np.isnan(joints)
            if (unknown.any(axis=1) != unknown.all(axis=1)).any() or np.isinf(joints).any():
                raise InputError("joints that are stated in part", column=name, expected="all finite, or all NaN")
        if count and not ((previous >= -1) & (previous < count)).all():
            raise InputError("a target before that is none", column="previous", expected=f"-1 to {count - 1}")
        if q_start is not None and not np.isfinite(q_start).all():
            raise InputError("a start that is no place", column="q_start", expected="finite joints", found=str(q_start))
        is_pose = np.isnan(q_rad[:, 0])
        if not np.isfinite(X[is_pose]).all():
            raise InputError("a target that is neither joints nor a pose", column="X", expected="finite poses")
        if is_pose.any() and n != 6:
            raise InputError(
                "poses leave it open how this arm reaches them", expected="an arm of six joints", found=f"{n} joints"
            )
        parent = np.where(is_pose & np.isnan(q_near_rad[:, 0]), previous, -1)
        X, q_rad, q_near_rad = X.copy(), q_rad.copy(), q_near_rad.copy()
        if q_start is not None:
            parent = np.append(np.where(is_pose & np.isnan(q_near_rad[:, 0]) & (parent < 0), count, parent), -1)
            X = np.concatenate([X, np.eye(4)[None]])
            q_rad = np.concatenate([q_rad, np.asarray(q_start, float)[None]])
            q_near_rad = np.concatenate([q_near_rad, np.full((1, n), np.nan)])
            is_straight = np.append(is_straight, False)
        starts = np.unique(parent[parent >= 0])
        starts = starts[~np.isnan(q_rad[starts, 0])]
        X[starts] = flange_poses(robot, q_rad[starts])
        return cls(X, q_rad, q_near_rad, parent, _order(parent), is_straight)


def _order(parent: Array) -> Array:
    count = len(parent)
    if (parent < np.arange(count)).all():
        return np.arange(count)
    edges = coo_array((np.ones(count, bool), (np.where(parent < 0, count, parent), np.arange(count))), (count + 1,) * 2)
    order = breadth_first_order(edges.tocsr(), count, return_predecessors=False)
    return np.asarray(order[1:])


def flange_poses(robot: NominalRobot, q_rad: Array) -> Array:
    """``(N, 4, 4)``, in chunks that fit the cache."""
    X = np.empty((len(q_rad), 4, 4))
    for start in range(0, len(q_rad), CHUNK):
        X[start : start + CHUNK] = nominal_flange_poses(robot, q_rad[start : start + CHUNK])
    return X
