"""Which poses would tell confused causes apart, given the data so far."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from truepath.ambiguity import Confusion
from truepath.calibrate import KinematicFit
from truepath.context import Context
from truepath.effect_fit import EffectFit, linearise
from truepath.effects.steps import clock_of
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.motions import ChainPoses
from truepath.next_poses import candidates, most_telling
from truepath.poe_symbolic import PoseProblem
from truepath.search import Search
from truepath.term_set import TermSet

FULL_CIRCLE = np.pi


def poses_that_tell(
    kinematic: KinematicFit, fit: EffectFit, confusion: Confusion, spec: str | Path | None
) -> Array | None:
    """``(k, n)`` joints to measure next, in any order; None where no free pose was found.

    Args:
        kinematic: the fit to the data so far.
        fit: the present model.
        confusion: the causes to tell apart.
        spec: model of the cell, or None for the joint limits alone.
    """
    robot, context = kinematic.robot, kinematic.context
    if confusion.everywhere or confusion.withdrawn is None:
        lower, upper = np.full(robot.num_joints, -FULL_CIRCLE), np.full(robot.num_joints, FULL_CIRCLE)
    else:  # the tracker sees the probe there, and nothing else is needed
        lower, upper = context.q_rad.min(axis=0), context.q_rad.max(axis=0)
    drawn = candidates(robot, spec, lower, upper)
    if not len(drawn):
        return None
    search = Search(kinematic.fit, context, fit)
    so_far = _columns(search.by_kinematics, search.chain, TermSet.of(robot, search.seen, confusion.terms), fit.sigma)
    plausible = np.array([parameter.prior_scale for term in confusion.terms for parameter in term.parameters])
    prior = np.concatenate([search.kinematic_prior, plausible])
    rows = so_far.reshape(-1, so_far.shape[2])
    H = rows.T @ rows + np.diag(prior**-2.0)
    scale = np.diag(H) ** -0.5
    covariance = scale[:, None] * np.linalg.inv(scale[:, None] * H * scale) * scale

    def columns(q_rad: Array) -> Array:
        later = _later(q_rad, context)
        new = Measurements(q_rad, np.zeros((len(q_rad), 3)), None if fit.sigma.size == 3 else _upright(len(q_rad)))
        problem = PoseProblem(robot, new, kinematic.fit.problem.X_MB, kinematic.fit.problem.X_FE)
        near = linearise(problem, kinematic.fit.free, later, TermSet.of(robot, later, ()), fit.p, np.zeros(0))
        return _columns(near.kinematics, near.chain, TermSet.of(robot, later, confusion.terms), fit.sigma)

    return most_telling(columns, covariance, drawn)


def _columns(J: Array, chain: ChainPoses, terms: TermSet, sigma: Array) -> Array:
    return np.concatenate([J, terms.columns(chain, len(sigma))], axis=2) / sigma[:, None]


def _later(q_rad: Array, context: Context) -> Context:
    """Poses measured when the campaign goes on, at the last temperature."""
    N = len(q_rad)
    end = float(clock_of(context).max())
    later = Context(q_rad, None if context.payload_kg is None else float(np.median(context.payload_kg)))
    later = replace(later, **{context.clock: np.full(N, end)})
    if context.temperature_c is not None:
        later = replace(later, temperature_c=np.full(N, context.temperature_c[-1]))
    return later


def _upright(count: int) -> Array:
    return np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
