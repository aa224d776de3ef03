"""Guards that look along the whole path: limits of joint speed and acceleration, and room in the cell."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from truepath.calibration import Calibration
from truepath.guards import Finding
from truepath.lie import Array
from truepath.programs.motions import Kind
from truepath.rates import joint_motions, rate_findings, servo_motions, tool_motions
from truepath.rewriting.named_robot import ANOTHER_ROBOT, is_most_of
from truepath.rewriting.plan import Plan
from truepath.rewriting.ways import Ways

if TYPE_CHECKING:
    from truepath.posed_cell import Surroundings

QUARTERS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
STEP_RAD, MOST_STEPS = 0.1, 64  # between postures that are looked at on the way of a motion of the joints
SERVO_PERIOD_S = 0.002  # of servoj, where none is stated


def watch(
    plan: Plan, q_corrected_rad: Array, ways: Ways, calibration: Calibration, cell: str | Surroundings | None
) -> list[Finding]:
    """Joint limits of speed and acceleration along all motions whose start is known, and collisions in a cell."""
    findings = _rates_of_joints(plan, q_corrected_rad, calibration)
    findings += _rates_of_the_tool(plan, q_corrected_rad, ways, calibration)
    if cell is not None and len(plan):
        findings += _room(plan, q_corrected_rad, ways, calibration, cell)
    return findings


def _rates_of_joints(plan: Plan, q_corrected_rad: Array, calibration: Calibration) -> list[Finding]:
    motions, robot = plan.motions, calibration.model.robot
    findings = []
    for kind in (Kind.JOINT, Kind.SERVO):
        end = np.flatnonzero((motions.kind == kind) & (motions.previous >= 0))
        if not len(end):
            continue
        rates = []
        for q in (plan.q_today_rad, q_corrected_rad):
            ends = np.stack([q[motions.previous[end]], q[end]], axis=1)
            if kind == Kind.JOINT:
                rates.append(joint_motions(ends, motions.speed[end], motions.acceleration[end], motions.time_s[end]))
            else:
                time_s = np.where(np.isnan(motions.time_s[end]), SERVO_PERIOD_S, motions.time_s[end])
                rates.append(servo_motions(ends, time_s))
        findings += rate_findings(rates[0], rates[1], robot, motions.line[end])
    return findings


def _rates_of_the_tool(plan: Plan, q_corrected_rad: Array, ways: Ways, calibration: Calibration) -> list[Finding]:
    kept = np.flatnonzero(ways.followed)
    if not len(kept):
        return []
    target = ways.target[kept]
    programmed = _at_quarters(plan.q_rad, ways.q_rad, ways, kept)
    corrected = _at_quarters(q_corrected_rad, ways.q_corrected_rad, ways, kept)
    motions = plan.motions
    stated = motions.speed[target], motions.acceleration[target], motions.time_s[target]
    before, after = (
        tool_motions(q, ways.length_m[kept], ways.turn_rad[kept], *stated) for q in (programmed, corrected)
    )
    return rate_findings(before, after, calibration.model.robot, motions.line[target])


def _at_quarters(q_ends: Array, q_samples: Array, ways: Ways, kept: Array) -> Array:
    """``(W, 5, n)`` joints at the quarters of ways; those too short for samples are taken as straight in the joints."""
    start, end = q_ends[ways.start[kept]], q_ends[ways.target[kept]]
    count = np.diff(ways.first)[kept]
    q = start[:, None] + QUARTERS[:, None] * (end - start)[:, None]
    sampled = np.flatnonzero(count)
    for quarter in (1, 2, 3):
        index = ways.first[:-1][kept][sampled] + quarter * (count[sampled] + 1) // 4 - 1
        q[sampled, quarter] = q_samples[index]
    return q


def _room(
    plan: Plan, q_corrected_rad: Array, ways: Ways, calibration: Calibration, cell: str | Surroundings
) -> list[Finding]:
    from truepath.clearance import Cell
    from truepath.closer import clearance_findings, collide_all_along, compare, driven_findings

    along = along_the_program(plan, q_corrected_rad, ways)
    real = Cell(cell, calibration.model)
    today, then = real.clearances(along.q_today_rad), real.clearances(along.q_corrected_rad)
    places = compare(today, then)
    if places:  # only then it matters what the drawing says
        from truepath.model import nominal_model

        model = calibration.model
        drawn = Cell(cell, nominal_model(model.robot, model.X_MB_nominal, model.X_FE_nominal))
        places = compare(today, then, drawn.clearances(along.q_today_rad))
    driven = collide_all_along(today, then, along.line)
    by_itself = driven_findings(driven, along.line)
    if is_most_of(np.isin(plan.motions.line, along.line[[place.index for place in driven]])):
        by_itself = [replace(each, message=f"{each.message}; {ANOTHER_ROBOT}") for each in by_itself]
    return [*clearance_findings(places, along.line, driven=driven), *by_itself]


@dataclass(frozen=True, eq=False)
class AlongTheProgram:
    """K postures on the way through a program, in the order of its lines.

    Attributes:
        q_today_rad, q_corrected_rad: ``(K, n)``.
        line: ``(K,)``.
    """

    q_today_rad: Array
    q_corrected_rad: Array
    line: Array


def along_the_program(plan: Plan, q_corrected_rad: Array, ways: Ways) -> AlongTheProgram:
    """Targets, samples of the ways, and postures between targets of motions of the joints."""
    motions = plan.motions
    order = [motions.line.astype(float)]
    today, corrected, line = [plan.q_today_rad], [q_corrected_rad], [motions.line]
    way = np.repeat(np.arange(len(ways.target)), np.diff(ways.first))
    usable = ways.followed[way]
    target = ways.target[way][usable]
    today.append(ways.q_rad[usable])
    corrected.append(ways.q_corrected_rad[usable])
    line.append(motions.line[target])
    order.append(motions.line[target] - 1 + ways.share[usable])
    end = np.flatnonzero(np.isin(motions.kind, (Kind.JOINT, Kind.SERVO)) & (motions.previous >= 0))
    start = motions.previous[end]
    steps = np.abs(plan.q_rad[end] - plan.q_rad[start]).max(axis=1, initial=0.0) / STEP_RAD
    count = np.minimum(np.ceil(steps).astype(int), MOST_STEPS) - 1
    count = np.maximum(count, 0)
    each = np.repeat(np.arange(len(end)), count)
    first = np.concatenate([[0], np.cumsum(count)])[:-1]
    share = (np.arange(len(each)) - first[each] + 1) / (count[each] + 1)
    for parts, q in ((today, plan.q_today_rad), (corrected, q_corrected_rad)):
        parts.append(q[start][each] + share[:, None] * (q[end] - q[start])[each])
    line.append(motions.line[end][each])
    order.append(motions.line[end][each] - 1 + share)
    # In the order of the program neighbours are near, which the search for collisions profits from.
    sequence = np.argsort(np.concatenate(order), kind="stable")
    return AlongTheProgram(*(np.concatenate(parts)[sequence] for parts in (today, corrected, line)))
