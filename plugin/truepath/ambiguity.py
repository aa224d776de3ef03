"""What the data cannot tell apart: causes that would leave the same readings, and why."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath.calibrate import KinematicFit
from truepath.contest import LEAST_LOG_ODDS
from truepath.effects import EFFECTS
from truepath.effects.base import Term
from truepath.effects.steps import clock_of
from truepath.motions import Moves
from truepath.nameless import in_time, waves_of_a_joint
from truepath.poe import ParameterName
from truepath.report.words import joints_phrase
from truepath.search import Search
from truepath.term_set import TermSet

SWEPT = 0.9  # share of the clock's variance that one joint's angle explains
AS_GOOD = 0.7  # share of a cause's chi-square that its stand-in must reach
CLOSE_ODDS = 5.0  # difference of log evidence that is no verdict: 150 to 1
COMPACT = (  # few parameters: their evidences can be compared as they are
    "joint_compliance",
    "encoder_scale",
    "backlash",
    "thermal_expansion",
    "warmup_drift",
    "frame_drift",
    "tool_shift",
)
PLAUSIBLE = {"joint_compliance": 2e-5, "encoder_scale": 2e-4}  # sizes that a robot may well have
GEOMETRY = "kinematic"
CAUTION = 2.0  # lengths are not independent of each other: their scatter tells too little
SMALL_RAD = np.radians(90.0)


@dataclass(frozen=True)
class Confusion:
    """Causes that stand in for each other.

    Attributes:
        effects: their names.
        why: for a reader.
        terms: what would have to be told apart, to plan poses by.
        withdrawn: name of the finding that is none because of this, if any.
        everywhere: whether poses must come from beyond the joint angles measured so far.
    """

    effects: tuple[str, ...]
    why: str
    terms: tuple[Term, ...]
    withdrawn: str | None = None
    everywhere: bool = False


def swept_joints(search: Search) -> list[int]:
    """Joints (from 1) whose angle went along with time."""
    clock = clock_of(search.seen)
    found = []
    for joint in range(1, search.kinematic.problem.robot.num_joints + 1):
        theta = search.seen.q_rad[:, joint - 1]
        span = float(np.ptp(theta))
        if span < np.radians(5.0):
            continue
        u = (theta - theta.min()) / span
        X = np.stack([np.cos(np.pi * k * u) for k in range(7)], axis=1)
        left = clock - X @ np.linalg.lstsq(X, clock, rcond=None)[0]
        if np.var(left) < (1.0 - SWEPT) * np.var(clock):
            found.append(joint)
    return found


def all_confusions(search: Search, kinematic: KinematicFit, named: tuple[Term, ...]) -> list[Confusion]:
    """Whatever the data cannot tell apart: findings ``named``, what geometry hides, the common length."""
    found = confusions_of_findings(search, named)
    others = (hidden_behind_geometry(search), common_length(search, kinematic))
    return found + [confusion for confusion in others if confusion is not None]


def confusions_of_findings(search: Search, terms: tuple[Term, ...]) -> list[Confusion]:
    """Findings that another cause explains about as well. ``search`` comes back with all terms in its model."""
    found, swept = [], swept_joints(search)
    for name in dict.fromkeys(term.effect for term in terms):
        own = tuple(term for term in terms if term.effect == name)
        found += [_sweep(search, name, own, joint) for joint in swept]
        if name in COMPACT:
            found.append(_equals(search, name, terms))
    return [confusion for confusion in found if confusion is not None]


def _sweep(search: Search, name: str, own: tuple[Term, ...], joint: int) -> Confusion | None:
    effect, context = EFFECTS[name], search.seen
    robot, clock = search.kinematic.problem.robot, "time" if context.time_s is not None else "the order of measurement"
    if effect.driver == "pose":
        own = tuple(term for term in own if term.joint == joint)
        stand_in = [in_time(term.moves, term.joint, context) for term in own]
        others = ["warmup_drift"] if own and own[0].moves is Moves.JOINT else []
        others += ["frame_drift"] if joint == 1 or not others else []
    elif effect.driver == "time":
        stand_in = [waves_of_a_joint(term.moves, term.joint, joint) for term in own]
        others = []
    else:
        return None
    if not own:
        return None
    search.look(without=own)
    explained = search.explained(own)
    as_good = search.explained(stand_in) > AS_GOOD * explained
    if as_good and not others:
        shares = {}
        for other in ("encoder_scale", "transmission_error", "axis_wobble"):
            offered = [t for t in EFFECTS[other].terms(robot, context) if t.joint == joint]
            shares[other] = search.explained(t.with_parameters(t.parameters[:24]) for t in offered) / explained
        others = [other for other, share in shares.items() if share > AS_GOOD] or [max(shares, key=lambda k: shares[k])]
    search.look()
    if not as_good:
        return None
    why = (
        f"joint {joint} was swept once through the campaign, so that its angle and {clock} went along with each other: "
        f"{_plain(name)} and {' or '.join(_plain(other) for other in others)} explain the readings about equally well. "
        "Measure some of the poses again, in an order that has nothing to do with the angle."
    )
    return Confusion((name, *others), why, (*own, *stand_in), withdrawn=name)


def _equals(search: Search, name: str, terms: tuple[Term, ...]) -> Confusion | None:
    own = tuple(term for term in terms if term.effect == name)
    search.look(without=own)
    trials = {}
    for other in COMPACT:
        if not EFFECTS[other].missing(search.seen) and (other == name or other not in {t.effect for t in terms}):
            trials[other] = search.trial(EFFECTS[other])
    gain = trials[name].gain
    close = [trial for trial in trials.values() if trial.name != name and trial.gain > gain - CLOSE_ODDS]
    # Two causes that both add to the model are no rivals.
    rivals = [t.name for t in close if search.gain_of((*own, *t.terms)) < max(t.gain, gain) + LEAST_LOG_ODDS]
    search.look()
    if gain < LEAST_LOG_ODDS or not rivals:
        return None
    best = max(trials.values(), key=lambda trial: trial.gain)
    why = (
        f"{_plain(name)} and {' or '.join(_plain(rival) for rival in rivals)} explain the readings about equally well "
        f"(the log odds differ by less than {CLOSE_ODDS:g}). More poses, further apart, would tell."
    )
    return Confusion((name, *rivals), why, (*own, *best.terms), withdrawn=name, everywhere=True)


def hidden_behind_geometry(search: Search) -> Confusion | None:
    """Effects of a plausible size that these poses could not show, free kinematics imitating all but a trace."""
    present = {(term.effect, term.joint) for term in search.fit.terms}
    robot, blurred = search.kinematic.problem.robot, []
    for name, size in PLAUSIBLE.items():
        for term in EFFECTS[name].terms(robot, search.seen):
            if (term.effect, term.joint) in present:
                continue
            columns = size * TermSet.of(robot, search.seen, [term]).columns(search.chain, len(search.fit.sigma))
            moved = float(np.sqrt(np.mean(np.sum(columns[:, :3, 0] ** 2, axis=1))))
            visible = 0.5 * float(np.sum(search.marginal.project(columns) ** 2))
            if moved > 2.0 * search.fit.sigma[0] and visible < 2.0 * LEAST_LOG_ODDS:
                blurred.append((term, moved))
    if not blurred:
        return None
    effects = tuple(dict.fromkeys(term.effect for term, _ in blurred))
    joints = sorted({term.joint for term, _ in blurred if term.joint})
    worst = 1e3 * max(moved for _, moved in blurred)
    small = bool(np.all(np.ptp(search.seen.q_rad, axis=0) < SMALL_RAD))
    where = "in the small part of the workspace that was measured" if small else "with these poses and this noise"
    what = "Measure poses from the whole workspace." if small else "Measure more poses."
    one = len(effects) == 1
    why = (
        f"{where}, {' and '.join(_plain(name) for name in effects)} of "
        f"{joints_phrase(joints)} look{'s' if one else ''} like other link lengths and joint zeros: of a usual size "
        f"{'it' if one else 'they'} would move the probe by up to {worst:.2f} mm and could not be seen. The "
        f"calibration holds where it was measured; elsewhere it may miss by as much. {what}"
    )
    return Confusion((*effects, GEOMETRY), why, tuple(term for term, _ in blurred), everywhere=True)


def common_length(search: Search, kinematic: KinematicFit) -> Confusion | None:
    """By how much all lengths are off together: the tracker's scale, the temperature, or the robot itself."""
    robot = search.kinematic.problem.robot
    names: list[ParameterName] = [name for name, free in zip(kinematic.names, kinematic.fit.free, strict=True) if free]
    term = EFFECTS["measurement_scale"].terms(robot, search.seen)[0]
    J = search.by_kinematics
    column = search.chain.displacement(Moves.ROBOT_LENGTHS)[:, : len(search.fit.sigma)]
    step = np.linalg.lstsq(
        (J / search.fit.sigma[:, None]).reshape(-1, J.shape[2]),
        (column / search.fit.sigma[:, None]).ravel(),
        rcond=None,
    )[0]
    own = np.array([name.group == "axis" and name.unit == "m" for name in names])
    found = search.fit.p[kinematic.fit.free]
    weight = float(step[own] @ step[own])
    if weight <= 0:
        return None
    scale = float(found[own] @ step[own]) / weight
    scatter = float(np.sqrt(np.sum((found[own] - scale * step[own]) ** 2) / max(own.sum() - 1, 1) / weight))
    if (
        abs(scale) * float(np.linalg.norm(search.chain.X_ME[:, :3, 3] - search.chain.X_MB[:3, 3], axis=1).mean())
        < (search.fit.sigma[0])
    ):
        return None
    grown = any(t.effect == "thermal_expansion" for t in search.fit.terms)
    causes = "the tracker's scale" if grown else "the tracker's scale or the temperature"
    warmth = "" if grown else " a robot as a whole warmer or colder than its drawing,"
    way_out = "" if grown else ", and so do these poses at a temperature some kelvins away, temperature_c recorded"
    why = (
        f"all lengths are {100 * abs(scale):.3f} % {'long' if scale > 0 else 'short'} on average "
        f"(± {100 * CAUTION * scatter:.3f} %, as the single lengths scatter): check {causes}. A tracker whose metre is "
        f"off,{warmth} and links of another length give the same readings in any pose. A scale bar tells them "
        f"apart{way_out}."
    )
    effects = ("measurement_scale", GEOMETRY) if grown else ("measurement_scale", "thermal_expansion", GEOMETRY)
    return Confusion(effects, why, (term,))


def _plain(name: str) -> str:
    return name.replace("_", " ")
