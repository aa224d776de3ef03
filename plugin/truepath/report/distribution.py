"""How the error is distributed on unseen poses, model by model, and where noise alone would put it."""

from __future__ import annotations

import numpy as np
from matplotlib.ticker import LogLocator

from truepath.report.canvas import NOISE, new_axes, write_svg
from truepath.report.drawn import COLOURS, NETWORK_STAGE, STAGE_NAMES, Drawn, Plot
from truepath.report.words import significant

DASHES = {"nominal": (0, (1, 1)), "kinematic": (0, (5, 2)), "final": "solid", "network": (0, (6, 2, 1.5, 2))}
KINDS = (("Position", "mm", 0), ("Orientation", "mrad", 3))


def distributions(drawn: Drawn, noise_floor_mm: float) -> list[Plot]:
    """Share of unseen poses with a smaller error, for position and, where measured, orientation."""
    plots = []
    for kind, unit, first in KINDS:
        stages = [stage for stage in ("nominal", *drawn.stages, NETWORK_STAGE) if stage in drawn.error_B]
        if not stages or not drawn.unseen.any() or drawn.error_B[stages[0]].shape[1] <= first:
            continue
        floor = noise_floor_mm if first == 0 else None
        plots.append(_plot(drawn, stages, kind, unit, first, floor))
    return plots


def _plot(drawn: Drawn, stages: list[str], kind: str, unit: str, first: int, floor: float | None) -> Plot:
    labels = {"x_label": f"{kind.lower()} error, {unit} (logarithmic)", "y_label": "share of unseen poses, %"}
    figure, axes = new_axes(400, 262, title=f"{kind} error on unseen poses", **labels)
    axes.set_xscale("log")
    axes.set_ylim(0, 102)
    smallest, largest, said = np.inf, 0.0, []
    for stage in stages:
        error = np.sort(drawn.error_length(stage, first))
        share = 100.0 * np.arange(1, len(error) + 1) / len(error)
        axes.step(error, share, where="post", color=COLOURS[stage], linewidth=1.8, linestyle=DASHES[stage], zorder=3)
        middle = float(np.median(error))
        smallest, largest = min(smallest, float(np.quantile(error, 0.01))), max(largest, float(error[-1]))
        said.append(f"{STAGE_NAMES[stage]} {significant(middle)} {unit}")
    if floor is not None and floor > 0:
        axes.axvline(floor, color=NOISE, linewidth=1.3, linestyle=(0, (4, 2)), zorder=2.5)
        smallest, largest = min(smallest, 0.8 * floor), max(largest, 1.25 * floor)
    if not smallest > 1e-4 * largest:
        smallest = 1e-4 * largest or 1e-6
    axes.set_xlim(0.8 * smallest, 1.25 * largest or 1.0)
    few = largest / smallest > 100
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if few else (1.0, 2.0, 5.0), numticks=12))
    axes.xaxis.set_minor_locator(LogLocator(subs=tuple(range(2, 10)), numticks=40))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_minor_formatter(lambda value, _: "")
    caption = "Half of the unseen poses are better than: " + ", ".join(said)
    return Plot(write_svg(figure, f"{kind} error on unseen poses. {caption}", f"distribution{first}"), caption)
