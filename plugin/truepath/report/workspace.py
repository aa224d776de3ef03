"""Error vectors where they occur: seen from above and from the side, before and after, all magnified alike."""

from __future__ import annotations

from typing import Any

import numpy as np

from truepath.lie import Array
from truepath.report.canvas import INK, MUTED, TEXT_SIZE, new_axes, write_svg
from truepath.report.drawn import BEFORE_STAGE, COLOURS, STAGE_NAMES, Drawn, Plot
from truepath.report.words import counted, significant

MOST_ARROWS = 260
SHARE_OF_VIEW = 0.09  # of the width that a typical arrow takes
VIEWS = (("from above", 0, 1), ("from the side", 0, 2))
SIZE = (420, 390)


def error_vectors(drawn: Drawn) -> list[Plot]:
    """Two views for each model."""
    if not drawn.stages or not len(drawn.row):
        return []
    shown = _spread(len(drawn.row))
    centre = 0.5 * (drawn.p_BE_mm.min(axis=0) + drawn.p_BE_mm.max(axis=0))
    # The base is worth seeing where it is near.
    corners = np.vstack([drawn.p_BE_mm, np.zeros(3)])
    if np.linalg.norm(centre) < 3000:
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    half = max(0.56 * float(np.ptp(corners, axis=0).max()), 1.0)
    lengths = np.linalg.norm(drawn.error_B[BEFORE_STAGE][:, :3], axis=1)
    factor = _round_number(SHARE_OF_VIEW * 2 * half / max(float(np.median(lengths)), 1e-9))
    return [
        _plot(drawn, stage, view, shown, centre, half, factor, f"arrows{stage}{view[2]}")
        for view in VIEWS
        for stage in drawn.stages
    ]


def _plot(
    drawn: Drawn,
    stage: str,
    view: tuple[str, int, int],
    shown: Array,
    centre: Array,
    half: float,
    factor: float,
    identity: str,
) -> Plot:
    name, across, up = view
    title = f"{STAGE_NAMES[stage].capitalize()}, {name}"
    x_label, y_label = f"{'xyz'[across]} of the robot base, mm", f"{'xyz'[up]}, mm"
    figure, axes = new_axes(*SIZE, title=title, x_label=x_label, y_label=y_label)
    box = axes.get_position()
    tall = box.height * SIZE[1] / (box.width * SIZE[0])
    axes.set_xlim(centre[across] - half / tall, centre[across] + half / tall)
    axes.set_ylim(centre[up] - half, centre[up] + half)
    axes.plot([0], [0], marker="s", markersize=9, color="#3c4650", markerfacecolor="#c9cdd2", zorder=2)
    axes.annotate("base", (0, 0), (8, -13), textcoords="offset points", fontsize=TEXT_SIZE - 0.5, color=MUTED)
    arrow: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0 / factor, "units": "dots"}
    error, p = drawn.error_B[stage], drawn.p_BE_mm
    for rows, width in ((shown[~drawn.unseen[shown]], 1.0), (shown[drawn.unseen[shown]], 1.9)):
        heads: dict[str, Any] = {
            "headwidth": 3.2 / width + 1,
            "headlength": 4.5 / width + 1,
            "headaxislength": 4.0 / width + 1,
        }
        axes.quiver(
            p[rows, across],
            p[rows, up],
            error[rows, across],
            error[rows, up],
            color=COLOURS[stage],
            width=width,
            zorder=3,
            **arrow,
            **heads,
        )
    length = _round_number(0.2 * 2 * half / factor)
    start = (centre[across] + half / tall - 0.05 * half - length * factor, centre[up] - 0.93 * half)
    axes.quiver(*start, length, 0.0, color=INK, width=1.6, zorder=5, **arrow)
    axes.text(
        start[0] + length * factor,
        start[1] + 0.035 * half,
        f"error of {significant(length, 1)} mm (\N{MULTIPLICATION SIGN} {factor:g})",
        ha="right",
        va="bottom",
        fontsize=TEXT_SIZE,
        color=INK,
        bbox={"facecolor": "#ffffff", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
    )
    several = counted(len(shown), drawn.noun) + ("" if len(shown) == len(drawn.row) else f" of {len(drawn.row)}")
    caption = f"errors drawn {factor:g} times larger; {several}"
    return Plot(write_svg(figure, f"Error vectors, {title}: {caption}", identity), caption)


def _spread(count: int) -> Array:
    if count <= MOST_ARROWS:
        return np.arange(count)
    return np.sort(np.random.default_rng(1).choice(count, MOST_ARROWS, replace=False))


def _round_number(value: float) -> float:
    """The next smaller of 1, 2, 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))
