"""Strict reading of delimited text: every cell keeps its line, every fault is told with line and column.

Used for measured data and for toolpaths; neither trusts a file, and an unreadable number is never guessed.
"""

from __future__ import annotations

import csv
import difflib
import io
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array

MAX_BYTES = 1 << 30
CUT_OFF = "the last line has no line end: was the file cut off?"
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Table:
    """Text cells of a file with one header line.

    Attributes:
        file: where it came from, for messages.
        header: column names as written, stripped.
        rows: cells, one list a row, all of the length of the header.
        lines: line number of each row as an editor shows it (the header is line 1).
        raw: the bytes of the file.
        decimal: the decimal separator.
    """

    file: Path
    header: tuple[str, ...]
    rows: list[list[str]]
    lines: Array
    raw: bytes
    decimal: str = "."

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def ends_within_a_line(self) -> bool:
        """Whether a line end is missing behind the last row; then a number may have lost its last digits."""
        last = self.raw[max(self.raw.rfind(b"\n"), self.raw.rfind(b"\r")) + 1 :]
        return bool(last.strip(b" \t,;"))

    def require(self, names: Sequence[str]) -> None:
        """Raises InputError for the first column that is not there, naming the one that looks like it."""
        for name in names:
            if name not in self.header:
                spare = [other for other in self.header if other not in names]
                near = difflib.get_close_matches(name, spare, n=1, cutoff=0.6)
                raise InputError(
                    "a column is missing",
                    file=self.file,
                    line=1,
                    column=name,
                    expected="columns " + ", ".join(names),
                    found=f"{', '.join(self.header)}" + (f" (did you mean {near[0]!r}?)" if near else ""),
                )

    def text(self, name: str) -> list[str]:
        column = self.header.index(name)
        return [row[column].strip() for row in self.rows]

    def numbers(self, names: Sequence[str]) -> Array:
        """``(rows, len(names))`` finite floats.

        Raises:
            InputError: first cell that is empty, no number, NaN or infinite, with its line and column.
        """
        return np.stack([self._numbers(name) for name in names], axis=1)

    def _numbers(self, name: str) -> Array:
        cells = self.text(name)
        try:
            if self.decimal == ",":
                if any("." in cell for cell in cells):
                    raise ValueError
                cells = [cell.replace(",", ".") for cell in cells]
            if any("_" in cell or not cell.isascii() for cell in cells):  # Python reads 1_000 and ١٢, nobody else does
                raise ValueError
            values = np.array([float(cell) for cell in cells])
        except ValueError:
            raise self._bad_cell(name) from None
        if not np.isfinite(values).all():
            raise self._bad_cell(name)
        return values

    def _bad_cell(self, name: str) -> InputError:
        for cell, line in zip(self.text(name), self.lines, strict=True):
            problem = self._fault(cell)
            if problem:
                return InputError(
                    problem,
                    file=self.file,
                    line=int(line),
                    column=name,
                    expected=f"a finite number with decimal {'comma' if self.decimal == ',' else 'point'}",
                    found=repr(cell),
                )
        raise AssertionError("no faulty cell")

    def _fault(self, cell: str) -> str | None:
        if not cell:
            return "a number is missing"
        if "_" in cell or not cell.isascii() or (self.decimal == "," and "." in cell):
            return "text where a number belongs"
        try:
            value = float(cell.replace(",", ".") if self.decimal == "," else cell)
        except ValueError:
            if self.decimal == "." and "," in cell:
                return "a decimal comma where a decimal point belongs"
            return "text where a number belongs"
        if np.isnan(value):
            return "not a number (NaN)"
        return None if np.isfinite(value) else "an infinite number"


def read_table(path: str | Path, *, delimiter: str = ",", decimal: str = ".", tell_cut_off: bool = True) -> Table:
    """Reads a UTF-8 text table with one header line; blank lines at the end are ignored.

    Args:
        path: of the file.
        delimiter, decimal: separators.
        tell_cut_off: log a warning where the last line has no line end; False: the caller tells it by itself.

    Raises:
        InputError: file missing, too large, not UTF-8, empty, doubled column, ragged row, blank line inside.
    """
    path = Path(path)
    raw = _read_bytes(path)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        found = f"byte 0x{error.object[error.start]:02x}"
        raise InputError("the file is not UTF-8 text", file=path, line=line, found=found) from None
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    rows, lines = [], []
    try:
        for row in reader:
            rows.append(row)
            lines.append(reader.line_num)
    except csv.Error as error:
        raise InputError(f"the table is broken ({error})", file=path, line=reader.line_num) from None
    while rows and not any(cell.strip() for cell in rows[-1]):
        rows.pop()
        lines.pop()
    if not rows:
        raise InputError("the file is empty", file=path, expected="a header line and rows of numbers")
    header = tuple(cell.strip() for cell in rows[0])
    if not any(header):
        raise InputError("the first line is empty", file=path, line=1, expected="a header line")
    if len(header) == 1 and any(other in header[0] for other in ",;\t"):
        raise InputError(
            "the columns are separated by something else",
            file=path,
            line=1,
            expected=f"columns separated by {delimiter!r}",
            found=header[0][:80],
        )
    for name in header:
        if header.count(name) > 1:
            raise InputError(
                "a column appears twice", file=path, line=1, column=name, expected="every name once", found=str(header)
            )
    for row, line in zip(rows[1:], lines[1:], strict=True):
        if len(row) != len(header):
            raise InputError(
                "a row is empty" if not any(row) else "a row has too many or too few cells",
                file=path,
                line=line,
                expected=f"{len(header)} cells separated by {delimiter!r}",
                found=f"{len(row)}",
            )
    if len(rows) == 1:
        raise InputError("the file has a header but no rows", file=path)
    table = Table(path, header, rows[1:], np.array(lines[1:]), raw, decimal)
    if tell_cut_off and table.ends_within_a_line:
        log.warning("warning: %s, line %d: %s", path, lines[-1], CUT_OFF)
    return table


def _read_bytes(path: Path) -> bytes:
    try:
        if not path.exists():
            raise InputError("no such file", file=path)
        if not path.is_file():
            raise InputError("this is not a file", file=path)
        if path.stat().st_size > MAX_BYTES:
            raise InputError("the file is larger than 1 GiB", file=path)
        return path.read_bytes()
    except OSError as error:
        raise InputError("the file cannot be read", file=path, found=error.strerror) from None
