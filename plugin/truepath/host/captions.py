"""What the panes on the screen say: the legend, and below it the place and what is to be heeded there."""

from __future__ import annotations

from textwrap import shorten
from typing import TYPE_CHECKING

import numpy as np

from truepath.host.course import Course
from truepath.preview.colours import (
    BAND_OPACITY,
    CORRECTED,
    ERROR_SCALE,
    OUTSIDE,
    PROGRAMMED,
    UNCORRECTED,
    on_white,
)
from truepath.preview.figures import in_mm

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from truepath.calibration_parts import StatisticsPart

INK, PALE, WARNING = "#1c1c1c", "#464646", "#8a4b00"
TEXT, SMALL = 9.6, 9.0  # points, of 1/72 inch at 100 pixels an inch: 13.3 and 12.5 pixels
LEFT_PX, ROW_PX = 12, 20
SWATCH_PX = 26
WIDTH_PX = 740  # seen whole where the screen is no wider than high, and beside Meshcat's own controls on wider ones
LEGEND_PX = (WIDTH_PX, 5 * ROW_PX + 10)
PLACE_PX, STILL_PX = (WIDTH_PX, 3 * ROW_PX + 10), (WIDTH_PX, 2 * ROW_PX + 10)  # with controls and without
LONGEST, LONGEST_BOLD = 98, 88  # letters that fit
KEYS = "Keys: space play/stop · ← → move · N, B warnings · C colour by error · 1 to 8 show/hide parts"
PARTS = {
    "arm_uncorrected": "orange ghost: today",
    "arm_corrected": "solid: corrected",
    "error_vectors": "arrows: errors",
    "tool_frames": "tool x, y, z: red, green, blue",
    "region": "pale green: measured",
}


def draw_legend(
    figure: Figure,
    course: Course,
    title: str,
    magnification: float,
    by_error: float | None,
    visible: dict[str, bool],
    model_error: StatisticsPart | None = None,
) -> None:
    """The title, how errors are drawn, what the lines are, and what all of it is worth.

    Args:
        by_error: end of the colour scale, mm; None: lines have one colour each.
        visible: the parts of the view, and which of them are shown.
        model_error: of the calibrated model on poses that it had not seen, mm; None: unknown.
    """
    page = _Rows(figure, LEGEND_PX)
    page.text(0, 0, shorten(title, 44, placeholder=" …"), bold=True)
    times = f"errors drawn {magnification:.4g} times as long" if magnification != 1 else "errors in true size"
    page.text(0, LEGEND_PX[0] - 2 * LEFT_PX, times, right=True, bold=True)
    real, corrected = (f"predicted mean {in_mm(e.mean)}, max {in_mm(e.max)} mm" for e in course.at_waypoints())
    page.swatch(1, 0, on_white(PROGRAMMED, BAND_OPACITY))
    page.text(1, 32, "programmed")
    page.swatch(1, 140, CORRECTED)
    page.text(1, 172, f"corrected: {corrected}")
    if course.fine.outside.any():
        page.swatch(1, 540, on_white(OUTSIDE, BAND_OPACITY))
        page.text(1, 572, "joints not measured")
    page.swatch(2, 0, UNCORRECTED if by_error is None else None)
    page.text(2, 32, f"real tool today: {real}")
    if by_error is not None:
        page.scale(2, 512, 130, by_error)
    if model_error is not None:
        known = f"{model_error.mean:.3f} mm (mean), {model_error.max:.3f} mm (max)"
        page.text(3, 0, f"the calibration itself was off by {known} on measured poses that it had not seen")
    page.text(4, 0, "  ·  ".join(text for part, text in PARTS.items() if visible[part]), pale=True)


def draw_place(figure: Figure, course: Course, share: float, chosen: int | None, keys: bool | None) -> None:
    """Where the tool is, how far off, and the warning that was stepped to.

    Args:
        chosen: which of the remarks; None: none.
        keys: whether there are controls, with keys of the keyboard; None: there are no controls.
    """
    page = _Rows(figure, STILL_PX if keys is None else PLACE_PX)
    page.text(0, 0, place_in_words(course, share))
    if chosen is not None:
        text = shorten(remark_in_words(course, chosen), LONGEST_BOLD, placeholder=" …")
        page.text(1, 0, text, colour=WARNING, bold=True)
    else:
        count = len(course.remarks)
        said = f"{count} warning{'' if count == 1 else 's'}" if count else "No warnings"
        page.text(1, 0, f"{said}: N for the next" if count and keys else said)
    if keys is not None:
        page.text(2, 0, KEYS if keys else "Open Controls, top right, has sliders and buttons", pale=True)


def place_in_words(course: Course, share: float) -> str:
    """The waypoint, the line of the program, and errors there."""
    (real, corrected), (waypoint, unknown), shown = course.errors_mm(share), course.towards(share), course.shown
    where = f"waypoint {waypoint + 1} of {len(shown.waypoint)}"
    if shown.line is not None:
        where = f"line {shown.line[waypoint]}"
    label = shown.labels[waypoint] if shown.labels else ""
    known = "; joints not measured here" if unknown else ""
    numbers = f"{real:.2f} mm off today, {in_mm(corrected)} mm corrected (predicted){known}"
    said = f"{where}: {numbers}"
    room = LONGEST - len(said) - 3
    return said + (f"   {shorten(label, room, placeholder=' …')}" if label and room > 10 else "")


def remark_in_words(course: Course, chosen: int) -> str:
    """A remark with its number."""
    return f"warning {chosen + 1} of {len(course.remarks)}: {course.remarks[chosen].text}"


class _Rows:
    """Rows of text on a picture, placed in pixels of the screen."""

    def __init__(self, figure: Figure, size_px: tuple[int, int]) -> None:
        self._figure, (self._width, self._height) = figure, size_px

    def _at(self, row: int, x: float) -> tuple[float, float]:
        return (LEFT_PX + x) / self._width, 1.0 - (ROW_PX * (row + 0.5) + 5) / self._height

    def text(
        self,
        row: int,
        x: float,
        text: str,
        *,
        bold: bool = False,
        pale: bool = False,
        right: bool = False,
        colour: str = INK,
    ) -> None:
        self._figure.text(
            *self._at(row, x),
            text,
            fontsize=SMALL if pale else TEXT,
            color=PALE if pale else colour,
            weight="bold" if bold else "normal",
            ha="right" if right else "left",
            va="center",
            parse_math=False,  # a program's line may hold any signs
        )

    def _axes(self, row: int, x: float, width: float, height: float) -> object:
        left, middle = self._at(row, x)
        h = height / self._height
        axes = self._figure.add_axes((left, middle - h / 2, width / self._width, h))
        axes.set_axis_off()
        return axes

    def swatch(self, row: int, x: float, colour: str | None) -> None:
        """A piece of line; None: with all colours of the scale."""
        shades = ERROR_SCALE if colour is None else (colour,)
        self._bar(row, x, SWATCH_PX, 6, shades)

    def _bar(self, row: int, x: float, width: float, height: float, shades: tuple[str, ...]) -> None:
        from matplotlib.colors import LinearSegmentedColormap

        axes = self._axes(row, x, width, height)
        scale = LinearSegmentedColormap.from_list("", [shades[0], *shades] if len(shades) == 1 else list(shades))
        axes.imshow(np.linspace(0, 1, 128)[None], aspect="auto", cmap=scale)  # type: ignore[attr-defined]

    def scale(self, row: int, x: float, width: float, end_mm: float) -> None:
        """The colour bar with its ends."""
        self._bar(row, x, width, 10, ERROR_SCALE)
        self.text(row, x - 8, "0", right=True)
        self.text(row, x + width + 8, f"{end_mm:.3g} mm")
