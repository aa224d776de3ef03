"""The file into which a run is recorded, sample by sample: whatever happens, what was seen is on the disk."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import TextIO

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array

COLUMNS = (
    "time_s",
    "targets_passed",
    *(f"q{k}_rad" for k in range(1, 7)),
    *(f"q{k}_target_rad" for k in range(1, 7)),
)


class RunFile:
    """A CSV file that grows; a context manager. Without a path nothing is recorded.

    Raises:
        InputError: it cannot be written. After that nothing more is.
    """

    def __init__(self, path: Path | None) -> None:
        self.rows, self._path = 0, path
        try:
            self._file = None if path is None else path.open("w", encoding="utf-8", newline="\n")
        except OSError as error:
            raise InputError("cannot write here", file=path, found=error.strerror) from None
        self._write(lambda file: file.write(",".join(COLUMNS) + "\n"))

    def __enter__(self) -> RunFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._close()

    def append(self, time_s: Array, passed: int, q_rad: Array, q_target_rad: Array) -> None:
        """Rows ``(B,)``, ``(B, 6)``, ``(B, 6)``, on the disk when this returns.

        ``passed`` targets are known by now to lie behind; one at which the robot rests is not yet among them.
        """
        self.rows += len(time_s)
        if self._file is None or not len(time_s):
            return
        rows = np.column_stack([time_s, np.full(len(time_s), passed), q_rad, q_target_rad])
        self._write(lambda file: np.savetxt(file, rows, fmt=["%.4f", "%d", *["%.8f"] * 12], delimiter=","))

    def _write(self, write: Callable[[TextIO], object]) -> None:
        if self._file is None:
            return
        try:
            write(self._file)
            self._file.flush()
        except OSError as error:
            self._close()
            raise InputError("cannot write here", file=self._path, found=error.strerror) from None

    def _close(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            with contextlib.suppress(OSError):  # of what a full disk has not taken
                file.close()
