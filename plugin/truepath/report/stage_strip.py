"""The strip of stages: how the error on unseen poses shrank as the model grew, as bars on a logarithmic scale."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from truepath.diagnosis import Diagnosis
from truepath.iso9283 import ErrorStatistics
from truepath.report.canvas import AFTER, BEFORE, NETWORK, NOMINAL
from truepath.report.words import effect_name, inside_sentence, millimetres_decimals

BETWEEN = "#56b4e9"
WITH_NETWORK = "+network"


@dataclass(frozen=True)
class Bar:
    """One model. Numbers are text; places are percent of the width of the strip."""

    name: str
    colour: str
    mean: str
    p95: str
    max: str
    mean_at: float
    p95_at: float
    max_at: float


@dataclass(frozen=True)
class Strip:
    """All models of a diagnosis, with the ticks of the scale and the noise floor (text and place) if known."""

    unit: str
    bars: tuple[Bar, ...]
    ticks: tuple[tuple[str, float], ...]
    floor: tuple[str, float] | None


def position(diagnosis: Diagnosis) -> Strip | None:
    """Of the position error, mm; None where there is no stage."""
    found = [(stage.model, stage.accuracy.position_mm) for stage in diagnosis.stages]
    return _strip(found, "mm", diagnosis.unexplained.noise_floor_mm)


def orientation(diagnosis: Diagnosis) -> Strip | None:
    """Of the orientation error, mrad; None where orientations were not measured."""
    measured = [(stage.model, stage.accuracy.orientation_mrad) for stage in diagnosis.stages]
    return _strip([(model, errors) for model, errors in measured if errors is not None], "mrad", None)


def stage_names(models: Sequence[str]) -> list[str]:
    """``kinematic+backlash`` as what it adds to the model before it."""
    names, previous = [], ""
    for model in models:
        if previous and model.startswith(f"{previous}+"):
            added = model[len(previous) + 1 :].split("+")
            names.append("+ " + ", ".join(inside_sentence(effect_name(effect)) for effect in added))
        elif "+" in model:
            names.append(" + ".join(inside_sentence(effect_name(part)) for part in model.split("+")).capitalize())
        else:
            names.append({"nominal": "Nominal", "kinematic": "Kinematic"}.get(model, effect_name(model)))
        previous = model
    return names


def _strip(found: Sequence[tuple[str, ErrorStatistics]], unit: str, floor: float | None) -> Strip | None:
    if not found:
        return None
    floor = floor if floor is not None and math.isfinite(floor) and floor > 0 else None
    means = [errors.mean for _, errors in found if errors.mean > 0]
    lowest = 0.6 * min([*means, *([floor] if floor else [])], default=1e-3)
    highest = max(1.05 * max(errors.max for _, errors in found), 2 * lowest)

    def place(value: float) -> float:
        share = math.log(max(value, lowest) / lowest) / math.log(highest / lowest)
        return round(100.0 * min(share, 1.0), 2)

    decimals = millimetres_decimals(min(means, default=1.0))
    last = max(k for k, (model, _) in enumerate(found) if not model.endswith(WITH_NETWORK))
    bars = []
    for k, ((_, errors), name) in enumerate(zip(found, stage_names([model for model, _ in found]), strict=True)):
        colour = (NOMINAL, BEFORE)[k] if k < 2 else (BETWEEN if k < last else AFTER if k == last else NETWORK)
        numbers = (errors.mean, errors.p95, errors.max)
        mean, p95, most = (f"{number:.{decimals}f}" for number in numbers)
        bars.append(Bar(name, colour, mean, p95, most, *map(place, numbers)))
    ticks = tuple((f"{tick:g}", place(tick)) for tick in _ticks(lowest, highest))
    return Strip(unit, tuple(bars), ticks, (f"{floor:.{decimals}f}", place(floor)) if floor else None)


def _ticks(lowest: float, highest: float) -> list[float]:
    steps = (1, 2, 5) if highest / lowest < 200 else (1,)
    powers = range(math.floor(math.log10(lowest)), math.ceil(math.log10(highest)) + 1)
    ticks = [step * 10.0**power for power in powers for step in steps]
    return [tick for tick in ticks if lowest <= tick <= highest]
