"""The note beside a corrected program whose format has no place for a stamp: by it truepath knows its own work.

A toolpath has no comments, so ``wp.csv.truepath.json`` beside ``wp.csv`` says what the stamp of a script says (see
``stamp``), with the hash of the whole file in the place of ``body-sha256``. Whoever changes the file, or copies it
without its note, makes it a program that nobody can recognise.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from datetime import date
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from truepath.errors import InputError
from truepath.files import write_atomically
from truepath.stamp import Stamp, already_corrected

SCHEMA: Literal["truepath.corrected/1"] = "truepath.corrected/1"
ENDING = ".truepath.json"
MAX_BYTES = 1 << 16
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class Note(BaseModel):
    """Content of the file.

    Attributes:
        version: of truepath.
        program_sha256, calibration_sha256, corrected_sha256: of the files, as bytes.
        replaced_sha256: of a corrected program that stood there before. It counts as well, so that there is no moment
            at which the old program is still there and its note is not.
        date: of the correction, ISO 8601.
    """

    model_config = ConfigDict(extra="forbid", strict=True)

    schema_: Literal["truepath.corrected/1"] = Field(alias="schema", default=SCHEMA)
    version: Annotated[str, Field(max_length=40)]
    program_sha256: Sha256
    calibration_sha256: Sha256
    corrected_sha256: Sha256
    replaced_sha256: Sha256 | None
    date: Annotated[str, Field(pattern=r"^[0-9]{4}-[0-9]{2}-[0-9]{2}$")]


def note_of(path: str | Path) -> Path:
    """Where the note of a file lies; beside what a link points to."""
    path = Path(path).resolve()
    return path.with_name(path.name + ENDING)


def refuse_if_noted(path: str | Path, content: bytes) -> None:
    """Refuses a program that truepath has corrected, by the note beside it.

    Raises:
        InputError: the note is of this content, or nobody can read it.
    """
    note = _read(note_of(path))
    if note is None or not _is_of(note, content):
        return
    day = date.fromisoformat(note.date)
    raise already_corrected(Stamp(note.version, note.program_sha256, note.calibration_sha256, day), path)


def write_with_note(path: str | Path, content: bytes, stamp: Stamp | None) -> None:
    """Writes a program and its note so that never a corrected program is there without its note.

    Args:
        path: of the program.
        content: of the program.
        stamp: what the note says, with the hash of the content; None for a program that needs no note: what lies there
            of an earlier one goes.

    Raises:
        InputError: a place that cannot be written to, or another file where the note belongs.
    """
    place = note_of(path)
    if stamp is None:
        write_atomically(path, content)
        drop_note(path)
        return
    assert stamp.body_sha256 is not None
    before = _read(place)
    note = Note(
        version=stamp.version,
        program_sha256=stamp.program_sha256,
        calibration_sha256=stamp.calibration_sha256,
        corrected_sha256=stamp.body_sha256,
        replaced_sha256=None if before is None else _corrected_there(Path(path), before),
        date=stamp.day.isoformat(),
    )
    write_atomically(place, _text(note))
    try:
        write_atomically(path, content)
    except BaseException:
        if before is None:
            place.unlink(missing_ok=True)
        else:
            write_atomically(place, _text(before))
        raise


def drop_note(path: str | Path) -> None:
    """Removes the note of a file that is no longer there, or no longer a corrected one; other files stay."""
    place = note_of(path)
    with suppress(InputError):
        if _read(place) is not None:
            place.unlink(missing_ok=True)


def _is_of(note: Note, content: bytes) -> bool:
    return hashlib.sha256(content).hexdigest() in (note.corrected_sha256, note.replaced_sha256)


def _corrected_there(path: Path, note: Note) -> str | None:
    """Hash of the corrected program that stands in a place, if it is one."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    return hashlib.sha256(content).hexdigest() if _is_of(note, content) else None


def _text(note: Note) -> str:
    return json.dumps(note.model_dump(by_alias=True), indent=1) + "\n"


def _read(place: Path) -> Note | None:
    """A note; None if there is none.

    Raises:
        InputError: what lies there is none.
    """
    try:
        if place.stat().st_size > MAX_BYTES:
            raise ValueError
        note = Note.model_validate_json(place.read_bytes())
        date.fromisoformat(note.date)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, ValidationError):
        raise InputError(
            "this is no note of truepath, so nobody can tell whether the program beside it is corrected already",
            file=place,
            expected=f"what truepath wrote (schema {SCHEMA!r}), or no such file beside a program as it was before",
        ) from None
    return note
