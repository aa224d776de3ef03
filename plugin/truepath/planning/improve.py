"""The next campaign of a robot that was measured before: poses for what is still uncertain or cannot be told apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from truepath.ambiguity import Confusion, all_confusions
from truepath.calibrate import fit_kinematics
from truepath.calibration import load_calibration
from truepath.choose import choose
from truepath.effects.base import Term
from truepath.measurements import Measurements
from truepath.pipeline import naming
from truepath.planning.campaign import CANDIDATES, LEAST_CANDIDATES, WORKSPACE, Pace, Plan, in_order, require_sense
from truepath.planning.design import Wish, design
from truepath.planning.effects_planned import planned_terms
from truepath.planning.feasible import Feasible
from truepath.planning.knowledge import Knowledge
from truepath.planning.setup import feasible_poses
from truepath.planning.sight import Sight
from truepath.planning.visits import Visiting
from truepath.readers import read_measurements
from truepath.robot import NominalRobot
from truepath.search import Search

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class NextPlan:
    """A plan, and why it is as it is.

    Attributes:
        plan: of the next poses.
        confusions: causes that the data so far cannot tell apart, which the poses are to tell.
    """

    plan: Plan
    confusions: tuple[Confusion, ...]


@threadpool_limits.wrap(limits=1)
def plan_improvement(
    feasible: Feasible,
    measurements: Measurements,
    effects: Sequence[str],
    wish: Wish,
    *,
    pace: Pace | None = None,
    seed: int = 0,
    candidates: int = CANDIDATES,
    say: Progress = lambda _: None,
) -> NextPlan:
    """Plans poses to be measured in addition to a data set.

    Args:
        feasible: the test of poses; its robot is the one that was measured.
        measurements: the data so far.
        effects: names of the effects of the calibration, and of others that shall be found.
        wish: how many stops, what for.
        pace: how fast the robot is driven.
        seed: of all chance.
        candidates: how many feasible poses to choose from.
        say: told what is being done.

    Raises:
        CalibrationError: the data cannot carry a calibration.
        InputError: as ``plan_campaign``.
    """
    require_sense(wish, seed)
    rng = np.random.default_rng(seed)
    say("fitting what was measured")
    kinematic = fit_kinematics(feasible.robot, measurements)
    found = choose(kinematic.fit, kinematic.context, list(dict.fromkeys(effects)), nameless=False).fit
    say("looking for what cannot be told apart")
    confusions = tuple(all_confusions(Search(kinematic.fit, kinematic.context, found), kinematic, found.terms))
    say("looking for poses all over the workspace")
    workspace = feasible.anywhere().draw(WORKSPACE, rng, roughly=True)
    if len(workspace) < LEAST_CANDIDATES:
        raise feasible.anywhere().complain(rng)
    drawn = feasible.draw(candidates, rng, say, roughly=True)
    if len(drawn) < LEAST_CANDIDATES:
        raise feasible.complain(rng)
    hoped, not_planned = planned_terms(feasible.robot, effects, workspace)
    # A common length, which no pose tells, is reported and not planned for.
    by_poses = [confusion for confusion in confusions if confusion.everywhere or confusion.withdrawn is not None]
    terms = _each_once([*found.terms, *(term for confusion in by_poses for term in confusion.terms), *hoped])
    knowledge = Knowledge.of(kinematic, found, terms)
    visiting = Visiting(knowledge.model, feasible, both_sides=knowledge.model.by_approach)
    chosen = design(visiting, drawn, workspace, wish, rng, knowledge.information, say)
    plan = in_order(visiting, chosen, pace or Pace(), rng, say)
    return NextPlan(replace(plan, not_planned=not_planned, candidates=len(drawn)), confusions)


def plan_from_files(
    files: tuple[Path, Path],
    robot: NominalRobot,
    cell: str | Path | None,
    sight: Sight | None,
    effects: str,
    wish: Wish,
    *,
    margin_m: float,
    pace: Pace,
    seed: int,
    say: Progress = lambda _: None,
) -> NextPlan:
    """The same from a calibration file and the data that it was made from, or more.

    Args:
        files: calibration and data.
        robot: as it stands in its cell.
        cell: model of the cell, None for none.
        sight: the tracker.
        effects: names with commas of what shall be found besides the calibration's effects, or ``none``.
        wish, pace, seed, say: as ``plan_improvement``.
        margin_m: clearance to keep.

    Raises:
        InputError: a file that cannot be read, of another robot; and as ``plan_improvement``.
    """
    calibration = load_calibration(files[0], robot)
    measurements = read_measurements(files[1], robot)
    named = () if effects == "none" else tuple(name.strip() for name in effects.split(","))
    names = (*(effect.name for effect in calibration.effects), *named)
    feasible = feasible_poses(robot, cell, "model", sight, model=calibration.model, margin_m=margin_m, seed=seed)
    with naming(files[1]):
        return plan_improvement(feasible, measurements, names, wish, pace=pace, seed=seed, say=say)


def _each_once(terms: Sequence[Term]) -> tuple[Term, ...]:
    """The first term of each effect at each place: forms of one effect would stand in for each other."""
    first: dict[tuple, Term] = {}
    for term in terms:
        first.setdefault((term.effect, term.moves, term.joint), term)
    return tuple(first.values())
