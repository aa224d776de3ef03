"""The results on disk: a corrected program, and beside it how it came about. By that a batch knows what is done."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from truepath.batch.tasks import ENDINGS, RESULT, Task
from truepath.batch.work import Outcome, Status
from truepath.errors import InputError
from truepath.files import write_atomically
from truepath.rewriting.note import drop_note, write_with_note

SCHEMA: Literal["truepath.batch-result/1"] = "truepath.batch-result/1"
MAX_BYTES = 256 << 20


class Spread(BaseModel):
    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    mean: float
    max: float


class Unresolved(BaseModel):
    model_config = ConfigDict(extra="allow")

    line: int


class PathSummary(BaseModel):
    model_config = ConfigDict(extra="allow")

    added: int = 0


class Summary(BaseModel):
    """What ``truepath correct --json`` says of a program; what a batch adds up is named, all else is kept."""

    model_config = ConfigDict(extra="allow")

    targets: int = 0
    corrected: int = 0
    path: PathSummary = PathSummary()
    unresolved: list[Unresolved] = []
    warnings: list[str] = []
    outside_calibrated_region: int = 0
    displacement_mm: Spread | None = None
    predicted_error_before_mm: Spread | None = None
    predicted_error_after_mm: Spread | None = None


class Result(BaseModel):
    """Content of the file beside a corrected program.

    Attributes:
        key: hashes of all that the result depends on: program, calibration, options, and the version of truepath.
        output_sha256: of the corrected program; None where there is none.
        attempts: how often the program was handed to a worker until this came of it.
    """

    model_config = ConfigDict(extra="forbid", strict=True)

    schema_: Literal["truepath.batch-result/1"] = Field(alias="schema", default=SCHEMA)
    status: Status
    message: str
    key: dict[str, str]
    output_sha256: str | None
    attempts: int = Field(ge=1)
    worker: str
    seconds: float
    summary: Summary | None

    def to_json(self) -> str:
        return json.dumps(self.model_dump(by_alias=True), indent=1, allow_nan=False) + "\n"


def key_of(task: Task, program: bytes) -> dict[str, str]:
    """Hashes of all that the result of a task depends on."""
    return {"program_sha256": hashlib.sha256(program).hexdigest(), **task.prepared.key}


def read_program(task: Task) -> bytes:
    """Content of the program.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return task.program.read_bytes()
    except OSError as error:
        raise InputError("the program cannot be read", file=task.name, found=error.strerror) from None


def finished(task: Task) -> Result | None:
    """The result of a task if it is there and would be the same again; None if the task is to be done.

    Decided by content and never by time: hashes of program, calibration and options, and of what was written.
    What failed is done again, what was refused would be refused again.
    """
    result = _read(task.result)
    if result is None or result.status == "failed" or result.key != key_of(task, read_program(task)):
        return None
    return result if result.output_sha256 == _hash_of(task.output) else None


def keep(task: Task, outcome: Outcome, key: Mapping[str, str], attempts: int) -> Result:
    """Writes what came of a task; the word that it is done comes last.

    Where nothing came of it, a corrected program that an earlier batch has left there goes: it belongs to another
    program or calibration, and nobody must take it for the result of this one. What others wrote stays.

    Raises:
        InputError: the folder cannot be made or written to.
    """
    content, output_sha256 = outcome.content, None
    try:
        task.output.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError("the folder cannot be made", file=task.output.parent, found=error.strerror) from None
    message = outcome.message
    if content is not None:
        write_with_note(task.output, content, outcome.note)
        output_sha256 = hashlib.sha256(content).hexdigest()
    elif (there := _hash_of(task.output)) is not None:
        before = _read(task.result)
        if before is not None and before.output_sha256 == there:
            task.output.unlink()
            drop_note(task.output)
        else:
            message += f"\n{task.output} is there, but it is not the result of this program"
    result = Result(
        status=outcome.status,
        message=message,
        key=dict(key),
        output_sha256=output_sha256,
        attempts=attempts,
        worker=outcome.worker,
        seconds=outcome.seconds,
        summary=None if outcome.summary is None else Summary.model_validate(outcome.summary),
    )
    write_atomically(task.result, result.to_json())
    return result


def left_over(folder: Path, tasks: Sequence[Task]) -> list[Path]:
    """Corrected programs that an earlier batch has left in the folder, and that belong to none of these tasks."""
    ours = {task.result.resolve() for task in tasks}
    found = []
    for path in sorted(folder.rglob(f"*{RESULT}")):
        program = path.with_name(path.name.removesuffix(RESULT))
        if program.name.lower().endswith(ENDINGS) and program.is_file() and path.resolve() not in ours and _read(path):
            found.append(program)
    return found


def _read(path: Path) -> Result | None:
    """A result file; None if there is none, or none that can be trusted."""
    try:
        if path.stat().st_size > MAX_BYTES:
            return None
        return Result.model_validate_json(path.read_bytes())
    except (OSError, ValidationError):
        return None


def _hash_of(path: Path) -> str | None:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return None
