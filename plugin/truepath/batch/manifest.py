"""A manifest: which programs with which calibrations, as CSV or as JSON lines. Nothing in it is trusted."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from truepath.batch.settings import Settings
from truepath.batch.tasks import Wish
from truepath.errors import InputError
from truepath.tables import read_table

JSON_LINES = (".jsonl", ".ndjson")
CSV = ".csv"
MAX_BYTES = 256 << 20
NUMBERS = ("path_tolerance_mm", "max_correction_mm", "payload_kg")


class Row(Settings):
    """One line. Paths are relative to the manifest's folder, the output to the output folder."""

    program: str = Field(min_length=1)
    calibration: str = Field(min_length=1)
    output: str = Field(min_length=1)


COLUMNS = tuple(field.alias or name for name, field in Row.model_fields.items())


def read_manifest(path: Path, calibration: Path | None, defaults: Settings) -> list[Wish]:
    """Reads and checks all lines.

    Args:
        path: ``.csv`` with columns ``program, calibration, output`` and any of the settings, or ``.jsonl`` with an
            object of these names on each line. An empty cell or a name that is left out stands for the default.
        calibration: for lines that name none.
        defaults: settings for lines that have none of their own.

    Raises:
        InputError: with line and column.
    """
    ending = path.suffix.lower()
    if ending not in (CSV, *JSON_LINES):
        raise InputError(
            "this is neither a folder nor a manifest",
            file=path,
            expected=f"a folder of programs, or a name ending in {CSV} or {', '.join(JSON_LINES)}",
        )
    rows = _csv_rows(path) if ending == CSV else _json_rows(path)
    wishes = []
    for line, content in rows:
        row = _checked(path, line, content, calibration, defaults)
        settings = Settings.model_validate({name: getattr(row, name) for name in Settings.model_fields})
        stated = {
            name for name in ("cell", "controller_kinematics") if (("as" if name == "express" else name) in content)
        }
        own = settings.placed(path.absolute().parent)
        settings = settings.model_copy(update={name: getattr(own, name) for name in stated})
        folder = path.parent
        default = calibration is not None and "calibration" not in content
        file = calibration if default and calibration is not None else folder / row.calibration
        wishes.append(Wish(folder / row.program, file, Path(row.output), settings, path, line))
    if not wishes:
        raise InputError("the manifest names no program", file=path)
    return wishes


def _checked(path: Path, line: int, content: dict[str, Any], calibration: Path | None, defaults: Settings) -> Row:
    filled = {**defaults.model_dump(by_alias=True), **content}
    if calibration is not None:
        filled.setdefault("calibration", str(calibration))
    try:
        return Row.model_validate(filled)
    except ValidationError as error:
        first = error.errors()[0]
        column = str(first["loc"][0])
        if first["type"] == "extra_forbidden":
            raise InputError(
                "unknown column", file=path, line=line, column=column, expected=", ".join(COLUMNS)
            ) from None
        if column not in content:
            raise InputError("a value is missing", file=path, line=line, column=column) from None
        expected = first["msg"][0].lower() + first["msg"][1:]
        found = repr(content[column])[:200]
        raise InputError(
            "cannot read this value", file=path, line=line, column=column, expected=expected, found=found
        ) from None


def _csv_rows(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    table = read_table(path)
    for name in table.header:
        if name not in COLUMNS:
            raise InputError("unknown column", file=path, line=1, column=name, expected=", ".join(COLUMNS))
    table.require(["program", "output"])
    for line, cells in zip(table.lines.tolist(), table.rows, strict=True):
        stated = ((name, cell.strip()) for name, cell in zip(table.header, cells, strict=True))
        yield line, {name: _value(name, cell) for name, cell in stated if cell}


def _value(name: str, cell: str) -> str | float:
    """A number where one belongs; what is none stays text, and is refused as such."""
    if name not in NUMBERS or "_" in cell or not cell.isascii():  # Python reads 1_000, nobody else does
        return cell
    try:
        return float(cell)
    except ValueError:
        return cell


def _json_rows(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError("the manifest is too large", file=path, expected=f"{MAX_BYTES} bytes at most")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        found = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise InputError("the manifest cannot be read", file=path, found=found) from None
    for line, words in enumerate(text.split("\n"), start=1):
        if not words.strip():
            continue
        try:
            content = json.loads(words, object_pairs_hook=_without_doubles)
        except (ValueError, RecursionError) as error:
            raise InputError("this line is no JSON", file=path, line=line, found=str(error)[:200]) from None
        if not isinstance(content, dict):
            raise InputError("this line is no object", file=path, line=line, expected="{...}", found=words[:80])
        yield line, {name: value for name, value in content.items() if value is not None}


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a name appears twice")
    return content
