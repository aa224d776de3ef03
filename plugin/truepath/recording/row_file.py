"""The data set while it is being recorded: every row is on the disk before the robot moves on."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from truepath.errors import InputError
from truepath.files import write_atomically
from truepath.measurements import from_table
from truepath.planning.pose_list import PoseList
from truepath.recording.circumstances import Circumstances
from truepath.recording.visit import Recorded
from truepath.tables import Table, read_table

SCHEMA = "truepath.recording/1"
SAME_JOINTS_RAD = 1e-9
NOT_KNOWN = Circumstances()


class RowFile:
    """An open data set to which visits are appended; a context manager.

    Beside it lies ``NAME.progress.json``, which says to which list of poses it belongs, when it was begun, and with
    which robot, payload and tracker. Both are taken away again if they were made for nothing.

    Args:
        path: of the data set.
        poses: the list.
        poses_sha256: of the bytes of its file.
        header: columns of the data set.
        resume: go on with what is there, if anything is. A last line without its end is dropped: the row was never
            complete, and its pose is measured again.
        circumstances: written down in a new file, and compared with those of one that goes on.

    Attributes:
        done: rows of the list that have been measured.
        taken_over: what was there already.

    Raises:
        InputError: the file exists and nothing was said of resuming; it belongs to another list, or other
            circumstances; a row is not one of this list; somebody else is recording into it.
    """

    def __init__(
        self,
        path: Path,
        poses: PoseList,
        poses_sha256: str,
        header: Sequence[str],
        *,
        resume: bool,
        circumstances: Circumstances = NOT_KNOWN,
    ) -> None:
        self.path, self._poses, self._header = path, poses, list(header)
        self.done: set[int] = set()
        self.taken_over = Recorded(np.empty(0, int), np.empty((0, poses.q_rad.shape[1])), np.empty((0, 3)))
        self._last_time_s = 0.0
        require_free(path, resume=resume)
        side_file = progress_file(path)
        existed, self._is_new = path.exists(), False
        self._handle = _open(path)  # and locked: whoever comes too late must not touch the other file either
        try:
            is_empty = os.fstat(self._handle).st_size == 0
            if not (resume or is_empty):
                raise _exists(path)
            # An empty file without the other is one whose recorder was killed as it began.
            self._is_new = is_empty and not (existed and side_file.exists())
            if self._is_new:
                self._began_s = time.time()
                content: dict[str, Any] = {"schema": SCHEMA, "poses_sha256": poses_sha256}
                content |= {"began_unix_s": self._began_s, "circumstances": circumstances.as_json()}
                write_atomically(side_file, json.dumps(content, indent=1) + "\n")
            else:
                self._began_s = _read_progress(side_file, path, poses_sha256, circumstances)
                self._take_over()
            if os.fstat(self._handle).st_size == 0:
                self._write(self._header)
                _sync_folder(path)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> RowFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def time_s(self) -> float:
        """Seconds since the campaign began; never less than in the last row, whatever happens to the clock."""
        self._last_time_s = max(time.time() - self._began_s, self._last_time_s)
        return self._last_time_s

    def append(self, row: int, cells: Sequence[str]) -> None:
        """Writes the visit of a row of the list to the disk.

        Raises:
            InputError: the disk does not take it; it does not have the columns of the file.
        """
        assert row not in self.done
        if len(cells) != len(self._header):
            expected, found = f"{len(self._header)} cells", str(len(cells))
            raise InputError("a row of other columns", file=self.path, expected=expected, found=found)
        self._write(cells)
        self.done.add(row)

    def close(self) -> None:
        """A new file without a row is taken away: nothing was recorded."""
        if self._is_new and not self.done:
            for file in (self.path, progress_file(self.path)):
                with contextlib.suppress(OSError):
                    file.unlink()
        os.close(self._handle)

    def _write(self, cells: Sequence[str]) -> None:
        data = (",".join(cells) + "\n").encode()
        before = os.fstat(self._handle).st_size
        try:
            if os.write(self._handle, data) != len(data):
                raise OSError(0, "the disk is full")
            os.fsync(self._handle)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._handle, before)
            raise InputError("a row cannot be written", file=self.path, found=error.strerror) from None

    def _take_over(self) -> None:
        """Drops an unfinished line, then checks every row."""
        content = self.path.read_bytes()
        complete = content.rfind(b"\n") + 1
        if complete < len(content):
            os.ftruncate(self._handle, complete)
            os.fsync(self._handle)
        if content[:complete].count(b"\n") == 0:
            return
        if content[:complete].count(b"\n") == 1:
            header = content[:complete].decode("utf-8", "replace").strip().split(",")
            self._require_header(header)
            return
        table = read_table(self.path)
        self._require_header(table.header)
        data = from_table(table, self._poses.q_rad.shape[1])
        assert data.time_s is not None
        self._last_time_s = float(data.time_s[-1])
        rows = []
        for k, cell in enumerate(table.text("visit")):
            rows.append(self._row_of(table, k, cell, data.q_rad[k]))
            self.done.add(rows[-1])
        self.taken_over = Recorded(np.array(rows), data.q_rad, data.p_ME)

    def _row_of(self, table: Table, k: int, cell: str, q_rad: np.ndarray) -> int:
        """The row of the list that a row of the data is a visit of."""
        row = int(cell) - 1 if cell.isascii() and cell.isdigit() and len(cell) < 10 else -1
        fault = None
        if not (0 <= row < len(self._poses) and self._poses.measure[row]):
            fault = "no row of the pose list that is measured"
        elif row in self.done:
            fault = "a visit appears twice"
        elif np.abs(q_rad - self._poses.q_rad[row]).max() > SAME_JOINTS_RAD:
            fault = "the joints are not those of the pose list"
        if fault is not None:
            raise InputError(fault, file=self.path, line=int(table.lines[k]), column="visit", found=cell)
        return row

    def _require_header(self, header: Sequence[str]) -> None:
        if list(header) != self._header:
            expected, found = ",".join(self._header), ",".join(header)
            raise InputError("other columns than would be recorded", file=self.path, expected=expected, found=found)


def require_free(path: Path, *, resume: bool) -> None:
    """Raises InputError for an output that would have to be overwritten."""
    if path.exists() and not (resume and path.is_file()):
        raise _exists(path)


def _exists(path: Path) -> InputError:
    return InputError("the output exists", file=path, expected="a new file, or --resume to go on with this one")


def progress_file(path: Path) -> Path:
    """The file beside a data set that says what it is a recording of."""
    return path.with_name(path.name + ".progress.json")


def _open(path: Path) -> int:
    """The file, locked."""
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
    except OSError as error:
        raise InputError("cannot write here", file=path, found=error.strerror) from None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not os.path.samestat(os.fstat(handle), path.stat()):  # its first owner has just taken it away
            raise OSError
    except OSError:
        os.close(handle)
        raise InputError("somebody else is recording into this file", file=path) from None
    return handle


def _sync_folder(path: Path) -> None:
    """A new file is only there for sure when its folder is on the disk too."""
    folder = os.open(path.resolve().parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _read_progress(side_file: Path, path: Path, poses_sha256: str, circumstances: Circumstances) -> float:
    """When the recording began, as Unix time. Raises InputError unless the file belongs to this list and robot."""
    try:
        content = json.loads(side_file.read_bytes())
        if content["schema"] != SCHEMA:
            raise ValueError("unknown schema")
        began_s, found = float(content["began_unix_s"]), str(content["poses_sha256"])
        written = content.get("circumstances", {})  # older files tell nothing
        if not (np.isfinite(began_s) and isinstance(written, dict)):
            raise ValueError("no time")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"nothing says of which poses {path.name} is a recording",
            file=side_file,
            expected="the file that was written beside it",
            found=getattr(error, "strerror", None) or "something else",
        ) from None
    if found != poses_sha256:
        raise InputError(
            "the data belongs to another list of poses",
            file=path,
            expected=f"a recording of the list with hash {poses_sha256[:12]}",
            found=f"one of {found[:12]}",
        )
    circumstances.require_same(written, side_file)
    return began_s
