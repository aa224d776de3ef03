"""Following targets with an arm of which no closed form is known: Newton's method in small steps along the way."""

from __future__ import annotations

import numpy as np

from truepath import lie
from truepath.inverse import solve
from truepath.lie import Array
from truepath.model import nominal_model
from truepath.posture_targets import Targets, flange_poses
from truepath.robot import NominalRobot

STEP_M, STEP_RAD = 0.05, 0.1
MOST_STEPS = 200
MOST_JUMP_RAD = 0.5
NEAR_SINGULAR = 1e-3


def follow_by_steps(robot: NominalRobot, targets: Targets) -> tuple[Array, Array, Array]:
    """Joints ``(M, n)``, NaN where not reached; where they are a matter of chance ``(M,)``; where the start is unknown.

    The posture never changes on the way: what the arm would do to get into another one is not looked for.
    """
    q, ambiguous = targets.q_rad.copy(), np.zeros(len(targets.parent), bool)
    stated = np.flatnonzero(targets.is_near_stated)
    q[stated], ambiguous[stated] = _reach(robot, targets.X[stated], targets.q_near_rad[stated])
    tried = ~targets.is_pose | targets.is_near_stated
    while True:
        # All at once of which the target before is known: a program of one long chain goes target by target.
        parent = np.where(targets.parent < 0, 0, targets.parent)
        ready = np.flatnonzero(targets.follows & ~tried & tried[parent] & ~np.isnan(q[parent, 0]))
        if len(ready) == 0:
            return q, ambiguous, ~tried
        q[ready], ambiguous[ready] = _reach(robot, targets.X[ready], q[targets.parent[ready]])
        tried[ready] = True


def _reach(robot: NominalRobot, X: Array, q_from: Array) -> tuple[Array, Array]:
    """Joints ``(K, n)`` at poses ``(K, 4, 4)``, going there from joints ``(K, n)``; NaN where that fails."""
    if len(X) == 0:
        return q_from, np.zeros(0, bool)
    forward = nominal_model(robot).flange_poses_and_jacobian
    X_from = flange_poses(robot, q_from)
    way = lie.pose_error(X, X_from)
    size = np.linalg.norm(way.reshape(-1, 2, 3), axis=2) / [STEP_RAD, STEP_M]
    steps = int(min(MOST_STEPS, np.ceil(size.max(initial=1.0))))
    q, good = q_from, np.ones(len(X), bool)
    for share in np.arange(1, steps + 1) / steps:
        turn = lie.from_rotation_vector(share * way[:, :3]) @ X_from[:, :3, :3]
        goal = X if share == 1 else lie.make_pose(turn, X_from[:, :3, 3] + share * way[:, 3:])
        solution = solve(forward, goal, q)
        good &= solution.converged & (np.abs(solution.q_rad - q).max(axis=1) < MOST_JUMP_RAD)
        q = solution.q_rad
    good &= ((q >= robot.lower_rad) & (q <= robot.upper_rad)).all(axis=1)
    return np.where(good[:, None], q, np.nan), good & (solution.smallest_singular_value < NEAR_SINGULAR)
