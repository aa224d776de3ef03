"""Which joints a controller takes for targets that a program states as poses: the nearest to where it comes from.

Frames: of the arm that is given, B its base and F its flange; for a ``Controller`` these are C and 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath.controller import Controller
from truepath.lie import Array
from truepath.posture_choice import TELL_POSTURES, TURN, Walk, nearest
from truepath.posture_polish import newton, polished
from truepath.posture_steps import follow_by_steps
from truepath.posture_targets import Targets
from truepath.robot import NominalRobot
from truepath.ur_postures import Candidates, ThreeParallelAxes

LIMIT_RAD, SAME_RAD = 1e-6, 1e-6
STEPS_AT_THE_EDGE, SAME_POSTURE_RAD = 12, 0.5
ANOTHER_RAD = 0.05  # further than an arm is askew: into another posture
MISSED_BY_RAD, SURELY_NEAREST_RAD = 1.0, 0.02


@dataclass(frozen=True, eq=False)
class FollowedTargets:
    """The joints with which a controller reaches N targets, as far as they can be told.

    Attributes:
        q_rad: ``(N, n)``; NaN where not reached.
        reached: ``(N,)`` True where joints were stated, or were found that reach the pose.
        ambiguous: ``(N,)`` another posture is nearly as near, or two joints are not determined singly; ``q_rad`` is
            the nearest, or one of them.
        start_unknown: ``(N,)`` nobody knows from where the robot comes, so any posture is possible. That is so after
            a target out of reach, too.
        certain: ``(N,)`` reached, and no ambiguous target is before it since joints were last known.
    """

    q_rad: Array
    reached: Array
    ambiguous: Array
    start_unknown: Array
    certain: Array


def follow_targets(
    arm: Controller | NominalRobot,
    X: Array,
    q_rad: Array,
    q_near_rad: Array,
    previous: Array,
    q_start: Array | None = None,
    is_straight: Array | None = None,
) -> FollowedTargets:
    """The joints at every target of a program.

    A target that is given as joints keeps them. A pose is reached in the posture nearest to ``q_near_rad`` where that
    is stated, else to the joints at the target before it: the least sum of squares over the joints, whole turns
    chosen within the limits. Along a straight line the posture stays what it was, and joints turn as far as the line
    turns them.

    Args:
        arm: its kinematics and limits; six joints.
        X: ``(N, 4, 4)`` flange poses, in the controller's frames for a controller; of no account where joints are
            given. On a straight line the flange is taken to run straight, which is near enough to count its turns.
        q_rad, q_near_rad: ``(N, n)``, NaN where not stated.
        previous: ``(N,)`` index of the target before it, -1 where unknown.
        q_start: ``(n,)`` from where the robot comes at every target whose ``previous`` is -1; None if unknown.
        is_straight: ``(N,)`` True where the tool comes along a straight line; nowhere if None.

    Raises:
        InputError: shapes that do not go together, an index out of range, or poses for an arm without six joints.
    """
    robot = arm.kinematics if isinstance(arm, Controller) else arm
    targets = Targets.of(robot, X, q_rad, q_near_rad, previous, q_start, is_straight)
    axes = ThreeParallelAxes.of(robot)
    if axes is None:
        q, ambiguous, start_unknown = follow_by_steps(robot, targets)
    else:
        q, ambiguous, start_unknown = _follow_in_closed_form(robot, axes, targets)
    reached = ~np.isnan(q[:, 0])
    start_unknown &= targets.is_pose
    ambiguous &= reached
    certain = _certain(targets, reached, ambiguous)
    count = len(X)
    return FollowedTargets(q[:count], reached[:count], ambiguous[:count], start_unknown[:count], certain[:count])


def _follow_in_closed_form(robot: NominalRobot, axes: ThreeParallelAxes, targets: Targets) -> tuple[Array, ...]:
    """Joints ``(M, 6)``, NaN where not reached; ties ``(M,)``; where the start is unknown ``(M,)``."""
    count = len(targets.parent)
    candidates, missed = _candidates(robot, axes, targets)
    walk = Walk(robot, axes, targets, candidates.q_rad, candidates.singular)
    q = targets.q_rad.copy()
    starts = np.unique(targets.parent[targets.follows])
    starts = starts[~targets.is_pose[starts]]
    walk.stand(starts, q[starts])
    walk.reach(np.flatnonzero(targets.is_near_stated), targets.q_near_rad[targets.is_near_stated])
    walk.go(~targets.follows)

    here = np.flatnonzero(targets.is_pose & (walk.posture >= 0))
    q[here] = candidates.q_rad[walk.posture[here], :, here] + TURN * walk.turns[:, here].T
    ambiguous = np.zeros(count, bool)
    ambiguous[here] = candidates.free[walk.posture[here], here]
    straight = here[targets.follows[here] & targets.is_straight[here]]
    parent = targets.parent[straight]
    before = walk.posture[parent]
    ambiguous[straight] |= candidates.singular[before, parent] | walk.lost[before, straight]
    chosen = here[~(targets.follows[here] & targets.is_straight[here])]
    near = np.where(targets.follows[chosen, None], q[targets.parent[chosen]], targets.q_near_rad[chosen])
    found = nearest(candidates.q_rad[:, :, chosen], near.T, robot.lower_rad, robot.upper_rad)
    ambiguous[chosen] |= found.is_tie | missed.may_be_nearer(chosen, near, found.distance_rad)
    if not axes.is_ideal:
        ideal, q[here] = q[here], polished(robot, targets.X[here], q[here], is_exact=False)
        ambiguous[here] |= np.abs(q[here] - ideal)[:, TELL_POSTURES].max(axis=1, initial=0.0) > ANOTHER_RAD
    else:
        q[here] = polished(robot, targets.X[here], q[here], is_exact=True)
    q[((q < robot.lower_rad - LIMIT_RAD) | (q > robot.upper_rad + LIMIT_RAD)).any(axis=1) & targets.is_pose] = np.nan
    start = np.where(targets.parent < 0, 0, targets.parent)
    start_unknown = targets.is_pose & ~targets.is_near_stated & ((targets.parent < 0) | (walk.posture[start] < 0))
    return q, ambiguous, start_unknown


@dataclass(frozen=True, eq=False)
class Missed:
    """Postures of the ideal arm next to a singularity, L of them, at which none of the real arm was found.

    Attributes:
        target: ``(L,)``.
        q_rad: ``(L, 6)`` of the ideal arm; NaN where that does not reach either.
    """

    target: Array
    q_rad: Array

    def may_be_nearer(self, chosen: Array, near_rad: Array, distance_rad: Array) -> Array:
        """``(K,)`` whether at targets ``(K,)`` one may be nearer to joints ``(K, 6)`` than what was chosen there."""
        order = np.argsort(chosen)
        place = np.minimum(np.searchsorted(chosen, self.target, sorter=order), max(len(chosen) - 1, 0))
        nearer = np.zeros(len(chosen), bool)
        if len(chosen) and len(self.target):
            k = order[place]
            away = (self.q_rad - near_rad[k])[:, TELL_POSTURES]
            away -= TURN * np.rint(away / TURN)
            is_nearer = ~(np.linalg.norm(away, axis=1) > distance_rad[k] + MISSED_BY_RAD)
            is_nearer &= distance_rad[k] > SURELY_NEAREST_RAD
            nearer[k[is_nearer & (chosen[k] == self.target)]] = True
        return nearer


def _candidates(robot: NominalRobot, axes: ThreeParallelAxes, targets: Targets) -> tuple[Candidates, Missed]:
    """All postures for poses and for what they follow; elsewhere NaN."""
    needed = targets.is_pose.copy()
    needed[targets.parent[targets.follows]] = True
    index = np.flatnonzero(needed)
    X = targets.X if needed.all() else targets.X[index]
    found = axes.solve(X)
    # Next to a singularity a small difference between the real arm and its ideal is a large one of the joints.
    posture, at = np.nonzero(found.doubtful)
    lost = np.isnan(found.q_rad[posture, 0, at])
    nowhere = index[at[lost]]
    posture, at = posture[~lost], at[~lost]
    ideal = found.q_rad[posture, :, at]
    q, good = newton(robot, X[at], ideal, steps=STEPS_AT_THE_EDGE)
    good &= np.abs(q - ideal)[:, TELL_POSTURES].max(axis=1, initial=0.0) < SAME_POSTURE_RAD
    found.q_rad[posture, :, at] = np.where(good[:, None], q - TURN * np.floor((q + np.pi) / TURN), np.nan)
    for other in (1, 2, 4):  # two that have become one
        away = np.abs(found.q_rad[posture, :, at] - found.q_rad[posture ^ other, :, at]).max(axis=1, initial=0.0)
        twin = (away < SAME_RAD) & (posture & other > 0)
        found.q_rad[posture[twin], :, at[twin]] = np.nan
    none = np.isnan(found.q_rad[posture, 0, at])
    missed = Missed(np.append(index[at[none]], nowhere), np.append(ideal[none], np.full((len(nowhere), 6), np.nan), 0))
    return (found if needed.all() else found.spread(index, len(needed))), missed


def _certain(targets: Targets, reached: Array, ambiguous: Array) -> Array:
    certain, parent = (reached & ~ambiguous).tolist(), targets.parent.tolist()
    for k in targets.order[targets.follows[targets.order]].tolist():
        certain[k] = certain[k] and certain[parent[k]]
    return np.array(certain, bool)
