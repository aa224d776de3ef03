"""Medians and ranges over the cases beside the paper's values, as the content of the JSON file.

Everything that is printed or written as markdown is made from this, so that all say the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from reproduction.cases import Case, Outcome
from reproduction.published import REQUIREMENTS, ROWS, STATISTICS, TABLES, Requirement

SCHEMA = "truepath.reproduction/1"


def summarise(outcomes: Sequence[Outcome], settings: dict[str, Any], skipped: Sequence[str]) -> dict[str, Any]:
    """The report.

    Returns:
        ``schema``, ``settings``, ``tables`` (with the paper's values and ours), ``ranges`` (the paper's network for
        several joint ranges), ``required``, ``skipped``, ``failed`` and, case by case, ``cases``.
    """
    good = [outcome for outcome in outcomes if outcome.trouble is None]
    return {
        "schema": SCHEMA,
        "settings": settings,
        "tables": [table for paper in TABLES if (table := _table(paper, good))["rows"]],
        "ranges": _ranges(good),
        "required": [found for wanted in REQUIREMENTS for found in _required(wanted, good)],
        "skipped": list(skipped),
        "failed": [{**_name(o.case), "trouble": o.trouble} for o in outcomes if o.trouble is not None],
        "cases": [_case(outcome) for outcome in good],
    }


def _table(paper: Any, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    rows = []
    for noise_mm, own in _by_noise(outcomes, paper.protocol).items():
        for row in ROWS:
            numbers: dict[str, Any] = {"row": row, "name": ROWS[row], "noise_mm": noise_mm}
            for statistic in STATISTICS:
                ours = _spread(_values(own, row, paper.quantity, statistic))
                numbers[statistic] = {"paper": paper.value_mm(row, statistic), "truepath": ours}
            if numbers["mean"]["truepath"] is not None:
                rows.append(numbers)
    return {"number": paper.number, "title": paper.title, "unit": "mm", "rows": rows}


def _ranges(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """The paper's network in its simulation, by joint range, and whether it reaches the paper's Table 1."""
    found = []
    own = [outcome for outcome in outcomes if outcome.case.protocol == "ranges"]
    for design in sorted({o.case.design for o in own if o.case.design}, key=lambda design: design.half_range_deg):
        here = [outcome for outcome in own if outcome.case.design == design]
        line: dict[str, Any] = {"half_range_deg": design.half_range_deg}
        for statistic in STATISTICS:
            paper = TABLES[0].value_mm("direct", statistic)
            ours = _spread(_values(here, "direct", "position_mm", statistic))
            met = None if ours is None or paper is None else ours["median"] <= paper
            line[statistic] = {"paper": paper, "truepath": ours, "reached": met}
        if line["mean"]["truepath"] is not None:
            found.append(line)
    return found


def _required(wanted: Requirement, outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """One line for each noise that the requirement is about and that was run."""
    found = []
    for noise_mm, own in _by_noise(outcomes, wanted.protocol).items():
        values = _values(own, wanted.row, wanted.quantity, wanted.statistic)
        if not values or wanted.noise_mm not in (None, noise_mm):
            continue
        ours = _spread(values)
        assert ours is not None
        line = {**asdict(wanted), "name": ROWS[wanted.row], "noise_mm": noise_mm, "truepath": ours}
        met_in = sum(value <= wanted.most_mm for value in values)
        found.append({**line, "met": ours["median"] <= wanted.most_mm, "met_in": met_in, "of": len(values)})
    return found


def _by_noise(outcomes: Sequence[Outcome], protocol: str) -> dict[float | None, list[Outcome]]:
    """The cases of a protocol by the noise of the simulated tracker; a real one has the noise it has."""
    parts: dict[float | None, list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.case.protocol == protocol:
            design = outcome.case.design
            parts.setdefault(None if design is None else design.noise_mm, []).append(outcome)
    return dict(sorted(parts.items(), key=lambda item: item[0] or 0.0))


def _values(outcomes: Sequence[Outcome], row: str, quantity: str, statistic: str) -> list[float]:
    own = [outcome.accuracy[row] for outcome in outcomes if row in outcome.accuracy]
    return [float(getattr(getattr(accuracy, quantity), statistic)) for accuracy in own]


def _spread(values: Sequence[float]) -> dict[str, float] | None:
    if not values:
        return None
    return {"median": float(np.median(values)), "least": min(values), "most": max(values)}


def _name(case: Case) -> dict[str, Any]:
    name: dict[str, Any] = {"protocol": case.protocol, "seed": case.seed}
    return name if case.design is None else {**name, **asdict(case.design)}


def _case(outcome: Outcome) -> dict[str, Any]:
    rows = {
        row: {**accuracy.to_dict(), **outcome.notes.get(row, {}), "seconds": round(outcome.seconds[row], 2)}
        for row, accuracy in outcome.accuracy.items()
    }
    return {**_name(outcome.case), "rows": rows}
