"""What the panes on the screen say: the legend above, the place and what is to be heeded there below."""

from __future__ import annotations

from textwrap import shorten
from typing import TYPE_CHECKING

import numpy as np

from truepath.host.course import Course
from truepath.preview.colours import (
    CORRECTED,
    ERROR_SCALE,
    OUTSIDE,
    PROGRAMMED,
    UNCORRECTED,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, PALE, WARNING = "#1c1c1c", "#505050", "#8a4b00"
TEXT, SMALL = 8.5, 7.5  # points, of 1/72 inch at 100 pixels an inch: 12 and 10 pixels
LEFT_PX, ROW_PX = 12, 19
SWATCH_PX = 26
LEGEND_PX, PLACE_PX = (860, 68), (860, 68)  # width and height of the panes
KEYS = "Keys: space play/stop   ← → move   N, B next, previous warning   C colour by error   1 to 8 show/hide parts"
PARTS = {
    "arm_uncorrected": "orange ghost: robot today",
    "arm_corrected": "solid: robot corrected",
    "error_vectors": "arrows: errors",
    "tool_frames": "x red, y green, z blue",
    "region": "green: the flange was measured here",
}


def draw_legend(
    figure: Figure, course: Course, title: str, magnification: float, by_error: float | None, visible: dict[str, bool]
) -> None:
    """The title, how errors are drawn, and what the lines are.

    Args:
        by_error: end of the colour scale, mm; None: lines have one colour each.
        visible: the parts of the view, and which of them are shown.
    """
    page = _Rows(figure, LEGEND_PX)
    page.text(0, 0, shorten(title, 40, placeholder=" …"), bold=True)
    times = f"errors drawn {magnification:g} times as long as they are" if magnification != 1 else "errors in true size"
    page.text(0, LEGEND_PX[0] - 2 * LEFT_PX, times, right=True, bold=True)
    real, corrected = (f"mean {e.mean():.3f}, max {e.max():.3f} mm" for e in (course.real_mm, course.corrected_mm))
    outside = bool(course.fine.outside.any())
    columns = (0, 190, 510)
    for x, text, colour in (
        (columns[0], "meant by the program", PROGRAMMED),
        (columns[1], f"real tool today: {real}", UNCORRECTED),
        (columns[2], f"corrected: {corrected}", CORRECTED),
    ):
        page.swatch(1, x, colour if by_error is None or colour == PROGRAMMED else None)
        page.text(1, x + SWATCH_PX + 6, text)
    if outside:
        page.swatch(0, 370, OUTSIDE)
        page.text(0, 370 + SWATCH_PX + 6, "joints not measured")
    if by_error is None:
        page.text(2, 0, "   ".join(text for part, text in PARTS.items() if visible[part]), pale=True)
    else:
        page.text(2, 0, "Colour of the lines: how far the tool is from where it is meant to be", pale=True)
        page.scale(2, 490, 240, by_error)


def draw_place(figure: Figure, course: Course, share: float, chosen: int | None) -> None:
    """Where the tool is, how far off, and the warning that was stepped to.

    Args:
        chosen: which of the remarks; None: none.
    """
    page = _Rows(figure, PLACE_PX)
    page.text(0, 0, place_in_words(course, share))
    if chosen is not None:
        page.text(1, 0, shorten(remark_in_words(course, chosen), 138, placeholder=" …"), colour=WARNING, bold=True)
    else:
        count = len(course.remarks)
        page.text(
            1, 0, f"{count} warnings: N for the next" if count > 1 else ("1 warning: N" if count else "No warnings")
        )
    page.text(2, 0, KEYS, pale=True)


def place_in_words(course: Course, share: float) -> str:
    """The waypoint, the line of the program, and errors there."""
    (real, corrected), (waypoint, unknown), shown = course.errors_mm(share), course.towards(share), course.shown
    where = f"waypoint {waypoint + 1} of {len(shown.waypoint)}"
    if shown.line is not None:
        where = f"line {shown.line[waypoint]}"
    label = shown.labels[waypoint] if shown.labels else ""
    known = "; joints not measured here" if unknown else ""
    numbers = f"tool {real:.2f} mm off today, {corrected:.3f} mm corrected{known}"
    return f"{where}: {numbers}" + (f"   {shorten(label, 60, placeholder=' …')}" if label else "")


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
