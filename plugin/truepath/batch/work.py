"""What a worker does: it gets programs and a calibration as bytes and gives corrected programs back as bytes.

A worker reads and writes none of the batch's files: it may see another disk.
"""

from __future__ import annotations

import os
import socket
import tempfile
import time
import traceback
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from threadpoolctl import threadpool_limits

import truepath
from truepath.batch.settings import Settings
from truepath.calibration import Calibration, load_calibration
from truepath.errors import InputError, TruepathError
from truepath.rewriting.rewrite import RewrittenProgram, rewrite_program
from truepath.stamp import Stamp

Status = Literal["corrected", "unchanged", "partial", "refused", "failed"]


@dataclass(frozen=True)
class Item:
    """A program: number of its task, name for messages, content."""

    number: int
    name: str
    content: bytes


@dataclass(frozen=True)
class Parcel:
    """Programs for one calibration and one set of options, corrected in one go.

    Attributes:
        version: of truepath that sends it.
        calibration: content of the file.
        settings: how.
        controller_file: content of the file that ``settings.controller_kinematics`` names, if it names one.
        items: programs.
    """

    version: str
    calibration: bytes
    settings: Settings
    controller_file: bytes | None
    items: tuple[Item, ...]


@dataclass(frozen=True)
class Outcome:
    """What became of a program.

    Attributes:
        number: of its task.
        status: ``corrected``; ``unchanged``: nothing had to move; ``partial``: some targets could not be resolved;
            ``refused``: a guard or a fault in the program; ``failed``: truepath or its worker broke.
        message: why it was refused or failed.
        summary: as ``truepath correct --json`` prints it.
        content: corrected program.
        note: what the note beside it says; None where it needs none.
        worker: who did it: host and process.
        seconds: that it took.
    """

    number: int
    status: Status
    message: str = ""
    summary: dict[str, Any] | None = None
    content: bytes | None = None
    worker: str = ""
    seconds: float = 0.0
    note: Stamp | None = None


def worker_version() -> str:
    """Of truepath, where it is called."""
    return truepath.__version__


def correct_parcel(parcel: Parcel) -> list[Outcome]:
    """Corrects all programs of a parcel; one that is refused or fails does not keep the others from it.

    Raises:
        InputError: the parcel comes from another version of truepath.
    """
    if parcel.version != truepath.__version__:
        found = f"{truepath.__version__} on {_who()}"
        raise InputError("this worker has another version of truepath", expected=parcel.version, found=found)
    with threadpool_limits(limits=1), tempfile.TemporaryDirectory(prefix="truepath-batch-") as folder:
        return [_correct(item, parcel, Path(folder)) for item in parcel.items]


def _correct(item: Item, parcel: Parcel, folder: Path) -> Outcome:
    start = time.perf_counter()
    # The readers of all formats read files. In messages the file has its own name.
    file = folder / f"program{Path(item.name).suffix}"
    names = [(str(file), item.name)]
    status: Status
    message, summary, content, note = "", None, None, None
    try:
        file.write_bytes(item.content)
        calibration = _calibration(parcel.calibration, parcel.settings.payload_kg)
        kinematics = parcel.settings.controller_kinematics
        if parcel.controller_file is not None:
            copy = folder / f"kinematics{Path(kinematics).suffix}"
            copy.write_bytes(parcel.controller_file)
            names.append((str(copy), kinematics))
            kinematics = str(copy)
        rewritten = rewrite_program(file, calibration, parcel.settings.options(calibration, kinematics))
        status, summary, content = _status(rewritten), _renamed(rewritten.summary(), names), rewritten.content
        note = rewritten.note
    except TruepathError as error:
        status, message = "refused", _renamed(str(error), names)
    except Exception as error:  # whatever one program brings about, the others are not concerned
        trace = "".join(traceback.format_exception(error)[-3:])
        status, message = "failed", _renamed(f"truepath broke, which is a fault of its own:\n{trace}", names)
    return Outcome(item.number, status, message, summary, content, _who(), time.perf_counter() - start, note)


def _status(rewritten: RewrittenProgram) -> Status:
    if rewritten.unresolved:
        return "partial"
    return "corrected" if rewritten.changed or rewritten.vias.added else "unchanged"


@lru_cache(maxsize=8)
def _calibration(content: bytes, payload_kg: float | None) -> Calibration:
    """Read and checked once in each process, however many programs need it."""
    with tempfile.TemporaryDirectory(prefix="truepath-batch-") as folder:
        file = Path(folder) / "calibration.json"
        file.write_bytes(content)
        return load_calibration(file).carrying(payload_kg)


def _renamed(value: Any, names: Iterable[tuple[str, str]]) -> Any:
    if isinstance(value, str):
        for temporary, name in names:
            value = value.replace(temporary, name)
        return value
    if isinstance(value, list):
        return [_renamed(each, names) for each in value]
    if isinstance(value, dict):
        return {key: _renamed(each, names) for key, each in value.items()}
    return value


def _who() -> str:
    return f"{socket.gethostname()}:{os.getpid()}"
