"""Which poses would tell confused causes apart, given the data so far."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truepath.ambiguity import Confusion
from truepath.calibrate import KinematicFit
from truepath.effect_fit import EffectFit
from truepath.errors import InputError
from truepath.model import nominal_model
from truepath.planning.campaign import Pace, in_order
from truepath.planning.design import Wish, design
from truepath.planning.feasible import Feasible
from truepath.planning.free_space import FreeSpace
from truepath.planning.knowledge import Knowledge
from truepath.planning.pose_list import PoseList
from truepath.planning.visits import Visiting

CANDIDATES, POSES = 300, 40


def poses_that_tell(
    kinematic: KinematicFit, fit: EffectFit, confusion: Confusion, spec: str | Path | None
) -> PoseList | None:
    """What to measure next, in an order that can be driven; None where hardly a free pose was found.

    The volume of the uncertainty of all parameters, those of the confused causes included, is made as small as a
    choice of poses can (D-optimal).

    Args:
        kinematic: the fit to the data so far.
        fit: the present model.
        confusion: the causes to tell apart.
        spec: model of the cell, or None for the joint limits alone.
    """
    robot, q_rad = kinematic.robot, kinematic.context.q_rad
    rng = np.random.default_rng(0)
    # Within the angles measured so far the tracker sees the probe; beyond is asked for only where it has to be.
    within = confusion.withdrawn is not None and not confusion.everywhere
    span = (q_rad.min(axis=0), q_rad.max(axis=0)) if within else None
    feasible = Feasible.within_limits(robot, kinematic.fit.problem.X_FE, _space(kinematic, spec), span_rad=span)
    try:
        feasible = feasible.from_home(rng)
        drawn = feasible.draw(CANDIDATES, rng, roughly=True)
        knowledge = Knowledge.of(kinematic, fit, confusion.terms)
        visiting = Visiting(knowledge.model, feasible)
        count = min(POSES, len(drawn) // 2)
        if not count:
            return None
        wish = Wish(count, 0, "D", local=False, compared=False)
        chosen = design(visiting, drawn, drawn, wish, rng, knowledge.information)
        return in_order(visiting, chosen, Pace(), rng).poses
    except InputError:  # nothing is free, or no way leads there: no reason to withhold a diagnosis
        return None


def _space(kinematic: KinematicFit, spec: str | Path | None) -> FreeSpace | None:
    """The cell; None where there is none, or nothing in it that could collide."""
    if spec is None:
        return None
    try:
        return FreeSpace(spec, nominal_model(kinematic.robot))
    except InputError:
        return None
