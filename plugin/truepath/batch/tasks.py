"""What a batch has to do: which program, with which calibration, into which file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from truepath.batch.settings import Prepared, Settings
from truepath.calibration import load_calibration
from truepath.errors import InputError
from truepath.rewriting.open import SCRIPTS, TOOLPATH
from truepath.robot import NominalRobot

ENDINGS = (*SCRIPTS, TOOLPATH)
RESULT = ".json"  # behind the whole name of a corrected program, so that a.script and a.csv have one each


@dataclass(frozen=True)
class Wish:
    """One program as a folder or a manifest names it; nothing about it is checked yet.

    Attributes:
        program, calibration: files.
        output: relative to the output folder.
        settings: of this program.
        source, line: the manifest and the line that says it; None for a folder.
    """

    program: Path
    calibration: Path
    output: Path
    settings: Settings
    source: Path | None = None
    line: int | None = None

    def fault(self, problem: str, column: str, expected: str | None = None, found: str | None = None) -> InputError:
        """An error that names the line of the manifest, or else the program."""
        file = self.source or self.program
        return InputError(
            problem,
            file=file,
            line=self.line,
            column=column if self.source else None,
            expected=expected,
            found=found,
        )


@dataclass(frozen=True, eq=False)
class Task:
    """One program to be corrected.

    Attributes:
        number: counts the tasks of a batch from 0.
        name: of the program, for people.
        program: file.
        output: file to write.
        prepared: calibration and settings.
    """

    number: int
    name: str
    program: Path
    output: Path
    prepared: Prepared

    @property
    def result(self) -> Path:
        """The file that says how it went."""
        return self.output.with_name(self.output.name + RESULT)


def wishes_in_folder(folder: Path, calibration: Path, settings: Settings) -> list[Wish]:
    """All programs in a folder and those within it; hidden files and folders do not count.

    Raises:
        InputError: there is none.
    """
    found = sorted(_programs(folder))
    if not found:
        raise InputError("there is no program", file=folder, expected=f"files that end in {', '.join(ENDINGS)}")
    return [Wish(path, calibration, path.relative_to(folder), settings) for path in found]


def _programs(folder: Path) -> Iterator[Path]:
    def fail(error: OSError) -> None:
        raise InputError("the folder cannot be read", file=error.filename, found=error.strerror)

    for place, folders, files in os.walk(folder, onerror=fail):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in files:
            if not name.startswith(".") and name.lower().endswith(ENDINGS):
                yield Path(place, name)


def make_tasks(
    wishes: Sequence[Wish], output: Path, robot: NominalRobot | None = None, reserved: Sequence[Path] = ()
) -> list[Task]:
    """Checks all wishes and reads all calibrations; nothing is written.

    Args:
        wishes: what to do.
        output: folder for the results; need not be there yet.
        robot: if given, all calibrations must be of this robot.
        reserved: files that the batch itself writes.

    Raises:
        InputError: a program or calibration that is missing or bad, two tasks that write one file, an output outside
            of the folder or over an input.
    """
    prepared: dict[tuple[Path, Settings], Prepared] = {}
    tasks = []
    for number, wish in enumerate(wishes):
        if not wish.program.is_file():
            raise wish.fault("there is no such program", "program", "a file", str(wish.program))
        if wish.program.suffix.lower() not in ENDINGS:
            raise wish.fault("unknown kind of program", "program", " or ".join(ENDINGS), str(wish.program))
        if wish.output.is_absolute() or ".." in wish.output.parts or not wish.output.name:
            raise wish.fault(
                "the output is no place in the output folder", "output", "a relative path", str(wish.output)
            )
        key = (wish.calibration, wish.settings)
        if key not in prepared:
            prepared[key] = _prepare(wish, robot)
        tasks.append(Task(number, str(wish.program), wish.program, output / wish.output, prepared[key]))
    _require_room(wishes, tasks, output, reserved)
    return tasks


def _prepare(wish: Wish, robot: NominalRobot | None) -> Prepared:
    try:
        calibration = load_calibration(wish.calibration, robot)
        return Prepared(wish.calibration, calibration, wish.calibration.read_bytes(), wish.settings)
    except OSError as error:
        raise InputError("the calibration cannot be read", file=wish.calibration, found=error.strerror) from None
    except InputError as error:
        if wish.source is None:
            raise
        raise InputError(str(error), file=wish.source, line=wish.line) from None


def _require_room(wishes: Sequence[Wish], tasks: Sequence[Task], output: Path, reserved: Sequence[Path]) -> None:
    """Every file is written by one task, and none of them is read; no file stands where a folder is needed."""
    taken: dict[Path, str] = {path.resolve(): "the summary of the batch" for path in reserved}
    for wish, task in zip(wishes, tasks, strict=True):
        for path in (task.output.resolve(), task.result.resolve()):
            if path in taken:
                raise wish.fault("two results would be one file", "output", f"not the file of {taken[path]}", str(path))
            taken[path] = task.name
    read = {path.resolve() for wish in wishes for path in (wish.program, wish.calibration, wish.source) if path}
    for wish, task in zip(wishes, tasks, strict=True):
        for path in (task.output, task.result):
            resolved = path.resolve()
            if resolved in read:
                raise wish.fault("the output is an input", "output", "another file", str(path))
            if path.is_dir():
                raise wish.fault("a folder stands where a result belongs", "output", "a file", str(path))
            above = next((parent for parent in resolved.parents if parent in taken or parent.is_file()), None)
            if above is not None:
                raise wish.fault("a file stands where a folder is needed", "output", "a folder", str(above))
    if output.exists() and not output.is_dir():
        raise InputError("the results need a folder", file=output, expected="a folder", found="a file")
