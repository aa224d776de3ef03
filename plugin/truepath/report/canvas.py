"""Plots as SVG elements that can stand in a page side by side: matplotlib's objects, none of its global state."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator, MultipleLocator

from truepath.lie import Array

# Okabe and Ito's colours, which colour-blind readers can tell apart.
NOMINAL, BEFORE, AFTER, NOISE, NETWORK = "#6b7580", "#d55e00", "#0072b2", "#009e73", "#cc79a7"
PALE = {BEFORE: "#efb48a", AFTER: "#6fb0d8", NOMINAL: "#aab2ba", NETWORK: "#e5bcd3"}
INK, MUTED, GRID = "#1c232b", "#56616d", "#e3e7eb"
TEXT_SIZE = 10.0
UNITS_PER_INCH = 72.0  # of the drawing; shown at its natural width, one is a CSS pixel
RASTER_DPI = 120.0
MOST_VECTOR_POINTS = 2000
MOST_DRAWN_POINTS = 3000
FEW_VALUES = 40  # of a thermometer that counts in tenths of a degree
GAP = 0.05  # share of the range that a line does not bridge


def new_axes(width: float, height: float, *, x_label: str, y_label: str, title: str = "") -> tuple[Figure, Axes]:
    """One plot of so many drawing units. Margins are fixed, so that plots side by side line up."""
    figure = Figure(figsize=(width / UNITS_PER_INCH, height / UNITS_PER_INCH), dpi=UNITS_PER_INCH)
    left, right, bottom, top = 55.0, 10.0, 36.0, 24.0 if title else 8.0
    axes = figure.add_axes(
        (left / width, bottom / height, (width - left - right) / width, (height - top - bottom) / height),
        facecolor="none",
    )
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color("#b9c2cb")
    axes.tick_params(which="both", colors="#b9c2cb", labelcolor=MUTED, labelsize=TEXT_SIZE - 0.5, length=3)
    axes.grid(True, color=GRID, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.set_xlabel(x_label, color=MUTED, fontsize=TEXT_SIZE)
    axes.set_ylabel(y_label, color=MUTED, fontsize=TEXT_SIZE)
    # Places are stated: to find them, matplotlib would lay out every text twice.
    axes.xaxis.set_label_coords(
        left / width + 0.5 * (width - left - right) / width, 10.0 / height, transform=figure.transFigure
    )
    axes.yaxis.set_label_coords(11.0 / width, 0.5 * (bottom + height - top) / height, transform=figure.transFigure)
    axes.yaxis.label.set_verticalalignment("center")
    axes.xaxis.label.set_verticalalignment("center")
    if title:
        axes.set_title(title, color=INK, fontsize=TEXT_SIZE + 1, fontweight="bold", loc="left", pad=7, y=1.0)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    return figure, axes


def mark_angles(axes: Axes, lowest: float, highest: float) -> None:
    """Ticks at angles that people know, degrees."""
    span = highest - lowest
    step = next((step for step in (1, 2, 5, 10, 15, 30, 45, 60, 90) if span / step <= 8), 180)
    axes.xaxis.set_major_locator(MultipleLocator(step))


def draw_points(axes: Axes, x: Array, y: Array, unseen: Array, colour: str, *, as_picture: bool) -> None:
    """A cloud of points: dots, and rings for those that ``unseen`` ``(N,)`` marks. Set the limits of the axes first.

    ``as_picture`` embeds it as pixels, which keeps the file small where there are thousands.
    """
    if as_picture:
        plain: dict[str, Any] = {"linestyle": "none", "rasterized": True, "clip_on": True}
        axes.plot(x[~unseen], y[~unseen], marker=".", markersize=3.0, markeredgewidth=0, color=colour, **plain)
        axes.plot(x[unseen], y[unseen], marker="o", markersize=3.2, markeredgewidth=0.7, color=colour, mfc="w", **plain)
        return
    _dots(axes, x[~unseen], y[~unseen], 2.6, colour)
    _dots(axes, x[unseen], y[unseen], 4.4, colour)
    _dots(axes, x[unseen], y[unseen], 2.4, "#ffffff")


def _dots(axes: Axes, x: Array, y: Array, size: float, colour: str) -> None:
    """All dots as one path: lines of no length with round ends. A tenth of the bytes of as many markers."""
    if not len(x):
        return
    vertices = np.repeat(np.column_stack([x, y]), 2, axis=0)
    path = Path(vertices, np.tile(np.array([Path.MOVETO, Path.LINETO], np.uint8), len(x)))
    path.should_simplify = False
    patch = PathPatch(path, fill=False, edgecolor=colour, linewidth=size, capstyle="round", zorder=2)
    axes.add_artist(patch)
    patch.set_clip_path(axes.patch)


def drawn_rows(count: int) -> Array:
    """Row numbers of as many points as are worth drawing, spread evenly by chance."""
    if count <= MOST_DRAWN_POINTS:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, MOST_DRAWN_POINTS, replace=False))


def symmetric_limit(*values: Array) -> float:
    """A bound within which all but a few of the values lie; a few far-off ones must not flatten all the others."""
    known = [np.abs(v[np.isfinite(v)]) for v in values]
    sizes = [min(1.15 * float(np.quantile(v, 0.995)), 6.0 * float(np.median(v))) for v in known if len(v)]
    return max(sizes, default=0.0) or 1.0


def write_svg(figure: Figure, label: str, identity: str) -> str:
    """The figure as an ``svg`` element.

    Args:
        figure: what was drawn.
        label: what it shows, for those who cannot see it.
        identity: unique in the page, letters and digits.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", dpi=RASTER_DPI, facecolor="none", metadata={"Date": None})
    svg = buffer.getvalue().decode("utf-8")
    view_box = re.search(r'viewBox="([\d. ]+)"', svg)
    assert view_box is not None
    body = svg[svg.index(">", view_box.end()) + 1 :]
    body = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->|<style.*?</style>", "", body, flags=re.DOTALL)
    width = float(view_box[1].split()[2])
    opening = f'<svg viewBox="{view_box[1]}" style="max-width:{1.3 * width:.0f}px" role="img"'
    return f'{opening} aria-label="{escape(label)}">{_compact(_own_ids(body, identity))}'


def _own_ids(body: str, identity: str) -> str:
    """Ids are unique in a page, not in a plot; those that nobody refers to go."""
    used = dict.fromkeys(re.findall(r'(?:url\(#|href="#)([^")]+)', body))  # matplotlib makes them at random
    names: dict[str, str] = {name: f"{identity}-{k}" for k, name in enumerate(used)}
    body = re.sub(r' id="([^"]+)"', lambda m: f' id="{names[m[1]]}"' if m[1] in names else "", body)
    return re.sub(r'(url\(#|href="#)([^")]+)', lambda m: m[1] + names[m[2]], body)


def _compact(body: str) -> str:
    """Hundredths of a pixel are enough, and most line ends are not needed."""

    def rounded(numbers: re.Match[str]) -> str:
        short = re.sub(r"-?\d+\.\d+", lambda m: f"{float(m[0]):.2f}".rstrip("0").rstrip("."), numbers[0])
        short = re.sub(r"\s+", " ", short)
        return re.sub(r"M ([\d.]+ [\d.]+) L \1(?= M|\s?\")", r"M\1h0", short)  # a dot

    body = re.sub(r' d="[^"]*"| [xy]="[^"]*"|translate\([^)]*\)', rounded, body)
    return re.sub(r">\s+<", "><", body)


def median_size(values: Array, rows: Array) -> float:
    """Median of the absolute values ``(N,)`` at ``rows`` ``(N,)``, NaN where there are none."""
    picked = np.abs(values[rows & np.isfinite(values)])
    return float(np.median(picked)) if len(picked) else float("nan")


def moving_median(x: Array, y: Array, most_bins: int) -> tuple[Array, Array]:
    """Medians of neighbours along x, at least eight of them each, as a line that breaks where x has a gap (NaN).

    Where x takes only a few values, a median for each of these. Empty where points are too few to say anything.
    """
    size = max(8, len(x) // most_bins)
    if len(x) < 6 * size:
        return np.zeros(0), np.zeros(0)
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    distinct = np.unique(x)
    if len(distinct) <= FEW_VALUES:
        parts = [rows for rows in (np.flatnonzero(x == value) for value in distinct) if len(rows) >= 8]
        return _medians(x, y, parts)
    runs = np.split(np.arange(len(x)), np.flatnonzero(np.diff(x) > GAP * (x[-1] - x[0])) + 1)
    lines = [_medians(x, y, np.array_split(run, len(run) // size)) for run in runs if len(run) >= size]
    if not lines:
        return np.zeros(0), np.zeros(0)
    broken = [np.append(line, [[np.nan], [np.nan]], axis=1) for line in map(np.array, lines)]
    joined = np.concatenate(broken, axis=1)[:, :-1]
    return joined[0], joined[1]


def _medians(x: Array, y: Array, parts: Sequence[Array]) -> tuple[Array, Array]:
    return np.array([np.median(x[rows]) for rows in parts]), np.array([np.median(y[rows]) for rows in parts])
