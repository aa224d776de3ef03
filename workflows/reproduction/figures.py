"""Errors pose by pose, in the style of the paper's figures 8, 9, 13 and 14."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reproduction.cases import Outcome
from reproduction.published import ROWS, TABLES, PaperTable

# Okabe and Ito's colours, which colour-blind readers can tell apart; markers tell the rows apart in grey, too.
STYLES = {
    "before": ("#6b7580", "s"),
    "kinematic": ("#d55e00", "^"),
    "direct": ("#cc79a7", "D"),
    "kinematic+network": ("#e69f00", "v"),
    "named": ("#56b4e9", "P"),
    "all": ("#0072b2", "o"),
}
INK, MUTED, GRID = "#1c232b", "#56616d", "#e3e7eb"
LIES_BELOW = ("named",)  # drawn wide: where no network was worth it, all of truepath is the same
WHAT = {
    "position": "positioning error, mm",
    "distance": "distance error, mm\n(mean over the distances to all other poses)",
}
LEAST_MM = 1e-4  # of the axis: nobody cares what happens below
DPI = 150


def draw_figures(outcomes: Sequence[Outcome], folder: Path) -> list[Path]:
    """One PNG for each figure of the paper, and for each noise of the simulated tracker; of the first case of each.

    Returns:
        The files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for table in TABLES:
        for noise_mm, outcome in _first_of_each(outcomes, table.protocol).items():
            noise = "" if noise_mm is None else f"_noise{noise_mm:g}mm"
            files.append(folder / f"figure{table.figure:02d}_{table.protocol}_{table.kind}{noise}.png")
            draw(table, outcome).savefig(files[-1], dpi=DPI)
    return files


def draw(table: PaperTable, outcome: Outcome) -> Figure:
    """The errors of one case, pose by pose, on a logarithmic scale: they span four orders of magnitude."""
    figure = Figure(figsize=(9.0, 5.6), layout="constrained")
    axes = figure.add_subplot()
    _prepare(axes)
    errors = outcome.position_mm if table.kind == "position" else outcome.distance_mm
    for row in ROWS:
        if row in errors:
            _draw_row(axes, row, errors[row])
    axes.set_title(_title(table, outcome), loc="left", color=INK, fontsize=11, fontweight="bold")
    axes.set_xlabel("verification pose", color=MUTED)
    axes.set_ylabel(WHAT[table.kind], color=MUTED)
    figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=9)
    return figure


def _draw_row(axes: Axes, row: str, errors_mm: np.ndarray) -> None:
    colour, marker = STYLES[row]
    label = f"{ROWS[row]}: mean {errors_mm.mean():.3g} mm"
    wide = row in LIES_BELOW
    axes.plot(
        np.arange(1, len(errors_mm) + 1),
        np.maximum(errors_mm, LEAST_MM),
        color=colour,
        marker=marker,
        markersize=6.5 if wide else 3.2,
        linewidth=3.0 if wide else 0.8,
        label=label,
    )


def _prepare(axes: Axes) -> None:
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.grid(True, color=GRID, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.margins(x=0.01)
    axes.tick_params(which="both", colors="#b9c2cb", labelcolor=MUTED)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color("#b9c2cb")


def _title(table: PaperTable, outcome: Outcome) -> str:
    case = outcome.case
    title = table.title[0].upper() + table.title[1:]
    if case.design is None:
        return f"{title}, split {case.seed}"
    noise = f"{case.design.noise_mm:g} mm noise" if case.design.noise_mm else "noise-free"
    return f"{title}, robot {case.seed}, {noise}, joints within ±{case.design.half_range_deg:g}°"


def _first_of_each(outcomes: Sequence[Outcome], protocol: str) -> dict[float | None, Outcome]:
    """The first robot or split by noise; None for that of a real tracker."""
    first: dict[float | None, Outcome] = {}
    for outcome in sorted(outcomes, key=lambda o: o.case.seed):
        if outcome.case.protocol == protocol and outcome.trouble is None:
            design = outcome.case.design
            first.setdefault(None if design is None else design.noise_mm, outcome)
    return first
