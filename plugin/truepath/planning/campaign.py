"""A whole campaign: poses, their order, the ways between them, what it will cost and what it will bring."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from truepath.errors import InputError
from truepath.lie import Array
from truepath.planning.design import CRITERIA, Design, Wish, design
from truepath.planning.effects_planned import planned_terms
from truepath.planning.feasible import Feasible
from truepath.planning.information import ReadingModel
from truepath.planning.order import Mixing, mixed_order, standardised
from truepath.planning.pose_list import NO_POSE, PoseList, robot_mark
from truepath.planning.visits import Visiting
from truepath.planning.ways import Ways

CANDIDATES, WORKSPACE = 1500, 500
LEAST_CANDIDATES = 30  # fewer, and the question is wrong rather than hard

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Pace:
    """How fast the robot is driven while it is measured; what a campaign takes is estimated from it.

    Attributes:
        speed_rad_s, acceleration_rad_s2: of the leading joint.
        stop_s: to settle and to be measured.
    """

    speed_rad_s: float = np.radians(30.0)
    acceleration_rad_s2: float = np.radians(80.0)
    stop_s: float = 4.0

    def duration_s(self, q_rad: Array, stops: int) -> float:
        """Along joints ``(N, n)``, from rest to rest between all of them, with so many stops to measure."""
        way = np.abs(np.diff(q_rad, axis=0)).max(axis=1)
        ramp = self.speed_rad_s**2 / self.acceleration_rad_s2
        fast = way / self.speed_rad_s + self.speed_rad_s / self.acceleration_rad_s2
        slow = 2.0 * np.sqrt(way / self.acceleration_rad_s2)
        return float(np.where(way >= ramp, fast, slow).sum()) + self.stop_s * stops


@dataclass(frozen=True, eq=False)
class Plan:
    """A campaign as it is written to the file, with what is expected of it.

    Attributes:
        poses: what to drive and where to measure.
        design: the chosen poses and their worth.
        model: the parameters that the campaign is for.
        mixing: how far the order tells time from poses.
        not_planned: effects that no choice of poses shows, such as those of time and temperature.
        candidates: how many feasible poses there were to choose from.
        travel_rad: sum over all ways of the turn of the leading joint.
        duration_s: estimated.
    """

    poses: PoseList
    design: Design
    model: ReadingModel
    mixing: Mixing
    not_planned: tuple[str, ...]
    candidates: int
    travel_rad: float
    duration_s: float

    @property
    def vias(self) -> int:
        """Rows of the file at which nothing is measured."""
        return int(np.count_nonzero(~self.poses.measure))


@threadpool_limits.wrap(limits=1)  # threads on matrices of this size cost more than they bring
def plan_campaign(
    feasible: Feasible,
    wish: Wish,
    sigma: Array,
    effects: Sequence[str] = (),
    *,
    pace: Pace | None = None,
    seed: int = 0,
    candidates: int = CANDIDATES,
    say: Progress = lambda _: None,
) -> Plan:
    """Plans the first campaign of a robot of which only the drawing is known.

    Args:
        feasible: the test of poses; with its ``home`` the campaign starts and ends.
        wish: how many stops, what for.
        sigma: ``(m,)`` expected noise of a reading, m and rad; m is 3 or 6.
        effects: names of the effects to be estimated besides the kinematics.
        pace: how fast it is driven.
        seed: of all chance.
        candidates: how many feasible poses to choose from.
        say: told what is being done.

    Raises:
        InputError: hardly any pose can be measured, too few poses for the parameters, no way between poses.
    """
    require_sense(wish, seed)
    rng = np.random.default_rng(seed)
    say("looking for poses all over the workspace")
    workspace = feasible.anywhere().draw(WORKSPACE, rng, roughly=True)
    if len(workspace) < LEAST_CANDIDATES:
        raise feasible.anywhere().complain(rng)
    terms, not_planned = planned_terms(feasible.robot, effects, workspace)
    drawn = feasible.draw(candidates, rng, say, roughly=True)
    if len(drawn) < LEAST_CANDIDATES:
        raise feasible.complain(rng)
    model = ReadingModel.nominal(feasible.robot, feasible.X_FE, drawn, terms, sigma)
    visiting = Visiting(model, feasible, both_sides=model.by_approach)
    chosen = design(visiting, drawn, workspace, wish, rng, say=say)
    plan = in_order(visiting, chosen, pace or Pace(), rng, say)
    return replace(plan, not_planned=not_planned, candidates=len(drawn))


def in_order(
    visiting: Visiting,
    chosen: Design,
    pace: Pace,
    rng: np.random.Generator,
    say: Progress = lambda _: None,
) -> Plan:
    """Puts chosen poses in order and leads the robot from each to the next.

    Args:
        visiting: how they are visited.
        chosen: the poses.
        pace: how fast it is driven.
        rng: of the order.
        say: told what is being done.
    """
    visited = np.concatenate([np.arange(len(chosen.q_rad)), np.array(chosen.again, int)])
    q_rad = chosen.q_rad[visited]
    say("looking at the ways between the poses")
    feasible = visiting.feasible
    ways, home = Ways(feasible.space, feasible.roadmap), feasible.home
    length = ways.lengths(np.vstack([q_rad, q_rad[:1] if home is None else home]))
    rows = visiting.model.readings(q_rad)
    first_visits = {pose: k for k, pose in enumerate(visited[: len(chosen.q_rad)].tolist())}
    twins = np.array([(first_visits[pose], len(chosen.q_rad) + k) for k, pose in enumerate(chosen.again)], int)
    say("putting them in order")
    order = mixed_order(length, standardised(q_rad, rows), twins.reshape(-1, 2), rng)
    poses = _driven(visiting, chosen, visited[order], order >= len(chosen.q_rad), ways, home, say)
    measured = poses.q_rad[poses.measure]
    return Plan(
        poses=poses,
        design=chosen,
        model=visiting.model,
        mixing=Mixing.of(measured, visiting.model.readings(measured)),
        not_planned=(),
        candidates=0,
        travel_rad=float(np.abs(np.diff(poses.q_rad, axis=0)).max(axis=1).sum()),
        duration_s=pace.duration_s(poses.q_rad, len(measured)),
    )


def _driven(
    visiting: Visiting, chosen: Design, visited: Array, once: Array, ways: Ways, home: Array | None, say: Progress
) -> PoseList:
    """Every row of the file: run-ups before the poses, detours where the straight way is blocked."""
    targets: list[tuple[Array, int]] = [] if home is None else [(home, NO_POSE)]
    run_ups = visiting.run_ups(chosen.q_rad, chosen.directions)
    numbers = {pose: k for k, pose in enumerate(dict.fromkeys(visited.tolist()))}  # counted as they come
    for pose, again in zip(visited.tolist(), once.tolist(), strict=True):
        sides = (0,) if again else tuple(range(visiting.stops))
        for side in sides:
            if visiting.both_sides:
                targets.append((run_ups[pose, side], NO_POSE))
            targets.append((chosen.q_rad[pose], numbers[pose]))
    if home is not None:
        targets.append((home, NO_POSE))
    rows: list[Array] = [targets[0][0]]
    pose_id = [targets[0][1]]
    for k, (target, number) in enumerate(targets[1:], start=1):
        say(f"way {k} of {len(targets) - 1}")
        for via in ways.between(rows[-1], target):
            rows.append(via)
            pose_id.append(NO_POSE)
        rows.append(target)
        pose_id.append(number)
    ids = np.array(pose_id)
    return PoseList(np.array(rows), ids != NO_POSE, ids, robot_mark(visiting.feasible.robot))


def require_sense(wish: Wish, seed: int) -> None:
    """Raises InputError for a wish that means nothing."""
    if wish.criterion not in CRITERIA:
        raise InputError(f"unknown criterion {wish.criterion!r}", expected=" or ".join(CRITERIA))
    if wish.stops < 1 or not 0 <= wish.repeats < wish.stops:
        found = f"{wish.stops} measurements, {wish.repeats} of them repeats"
        raise InputError("this is no campaign", expected="at least one pose that is no repeat", found=found)
    if seed < 0:
        raise InputError("a seed cannot be negative", found=str(seed))
