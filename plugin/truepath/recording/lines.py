"""The line protocol of trackers, read without trust.

UTF-8 lines. The first is the header ``t_s,x_mm,y_mm,z_mm``, optionally with ``,qw,qx,qy,qz``; then one reading a line,
``t_s`` being seconds of the tracker's clock. A line ``beam_break`` says that the beam is lost; readings follow when it
is back. Everything else is an error that names the line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from truepath.columns import QUATERNION_NORM_TOLERANCE
from truepath.errors import InputError
from truepath.measurements import FARTHEST_M

POSITION_COLUMNS = ("t_s", "x_mm", "y_mm", "z_mm")
POSE_COLUMNS = (*POSITION_COLUMNS, "qw", "qx", "qy", "qz")
BEAM_BREAK = "beam_break"
LONGEST_LINE = 400  # bytes; eight numbers of full length need half of it


@dataclass(frozen=True)
class TrackerLine:
    """One reading: numbers in the order of the columns, or None for a broken beam."""

    numbers: tuple[float, ...] | None


class LineReader:
    """Takes bytes in whatever pieces they come and makes lines of them; holds one unfinished line at most.

    Args:
        source: what the bytes come from, for messages.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.restart()

    def restart(self) -> None:
        """Forgets everything: a new stream begins with its header."""
        self._columns: tuple[str, ...] | None = None
        self._rest, self._line = b"", 0
        self._last_t_s = -math.inf

    def count_unread(self, lines: int) -> None:
        """So many lines of the stream are not shown to this reader."""
        self._line += lines

    @property
    def gives_orientation(self) -> bool | None:
        """Whether readings have a quaternion; None before the header."""
        return None if self._columns is None else self._columns == POSE_COLUMNS

    def feed(self, data: bytes) -> list[TrackerLine]:
        """The readings that these bytes complete.

        Raises:
            InputError: a line without end, no text, wrong columns, no number; with the number of the line.
        """
        *lines, rest = (self._rest + data).split(b"\n")
        found = []
        for raw in lines:
            self._line += 1
            line = self._read(raw.removesuffix(b"\r"))
            if line is not None:
                found.append(line)
        if len(rest) > LONGEST_LINE:
            self._line += 1
            raise self._error("a line without end", f"a line break within {LONGEST_LINE} bytes", _shown(rest))
        self._rest = rest
        return found

    def _read(self, raw: bytes) -> TrackerLine | None:
        if len(raw) > LONGEST_LINE:
            raise self._error("a line is too long", f"{LONGEST_LINE} bytes at most", _shown(raw))
        try:
            text = raw.decode("utf-8")
        except UnicodeDecodeError as error:
            found = f"byte 0x{raw[error.start]:02x} at place {error.start + 1}"
            raise self._error("this is not UTF-8 text", "a line of text", found) from None
        if self._columns is None:
            self._columns = self._header(text.removeprefix("\ufeff"))
            return None
        if text == BEAM_BREAK:
            return TrackerLine(None)
        return TrackerLine(self._numbers(text, self._columns))

    def _header(self, text: str) -> tuple[str, ...]:
        columns = tuple(cell.strip() for cell in text.split(","))
        if columns not in (POSITION_COLUMNS, POSE_COLUMNS):
            expected = f"the header {','.join(POSITION_COLUMNS)}, or that with ,qw,qx,qy,qz"
            raise self._error("this is no header of a tracker", expected, _shown(text.encode()))
        return columns

    def _numbers(self, text: str, columns: tuple[str, ...]) -> tuple[float, ...]:
        cells = text.split(",")
        if len(cells) != len(columns):
            expected = f"{len(columns)} numbers, {','.join(columns)}, or {BEAM_BREAK}"
            raise self._error("a wrong number of columns", expected, f"{len(cells)}: {_shown(text.encode())}")
        numbers = tuple(self._number(cell, name) for cell, name in zip(cells, columns, strict=True))
        if numbers[0] < self._last_t_s:
            raise self._error("time runs backwards", f"{self._last_t_s} or later", cells[0], "t_s")
        self._last_t_s = numbers[0]
        for name, number in zip(columns[1:4], numbers[1:4], strict=True):
            if abs(number) > 1e3 * FARTHEST_M:
                raise self._error("no tracker measures so far", f"within {FARTHEST_M:g} m", str(number), name)
        length = math.sqrt(sum(number**2 for number in numbers[4:])) if numbers[4:] else 1.0
        if abs(length - 1.0) > QUATERNION_NORM_TOLERANCE:
            expected = f"length 1 within {QUATERNION_NORM_TOLERANCE}"
            raise self._error("the quaternion is not of unit length", expected, f"{length:.6f}", "qw, qx, qy, qz")
        return numbers

    def _number(self, cell: str, column: str) -> float:
        try:
            if "_" in cell or not cell.isascii():  # Python reads 1_000 and ١٢, nobody else does
                raise ValueError
            number = float(cell)
        except ValueError:
            raise self._error("text where a number belongs", "a number", _shown(cell.encode()), column) from None
        if not math.isfinite(number):
            raise self._error("not a finite number", "a finite number", cell.strip(), column)
        return number

    def _error(self, problem: str, expected: str, found: str, column: str | None = None) -> InputError:
        return InputError(problem, file=self.source, line=self._line, column=column, expected=expected, found=found)


def _shown(raw: bytes) -> str:
    """The beginning of something that may be long and hostile, fit for a terminal."""
    text = ascii(raw[:60].decode("utf-8", "replace"))
    return text + (f" ... ({len(raw)} bytes)" if len(raw) > 60 else "")
