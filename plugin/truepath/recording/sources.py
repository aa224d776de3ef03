"""Where the lines of a tracker come from: a file that another program appends to, or a TCP stream."""

from __future__ import annotations

import contextlib
import os
import socket
import stat
import time
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Protocol

from truepath.errors import InputError
from truepath.recording.lines import LONGEST_LINE

PIECE = 1 << 16
POLL_S = 0.02
CONNECT_S = 3.0


@dataclass(frozen=True)
class Piece:
    """Some bytes of a stream.

    Attributes:
        data: may be empty.
        begins: whether they are the first of a stream, so that its header comes first.
        skipped_lines: complete lines left out after these bytes.
    """

    data: bytes = b""
    begins: bool = False
    skipped_lines: int = 0


class SourceLost(ConnectionError):  # noqa: N818 - an event, not a mistake in a program
    """Nothing can be read at the moment; reading again may find the source back."""


class Source(Protocol):
    """Gives bytes piece by piece."""

    name: str

    def read(self) -> Piece:
        """What has come meanwhile; waits for a moment. Raises SourceLost."""

    def close(self) -> None: ...


class FileSource:
    """The end of a growing file. Truncation and replacement by a new file are followed.

    Raises:
        InputError: there is no such file at the beginning.
    """

    def __init__(self, path: str | Path) -> None:
        self._path, self.name = Path(path), str(path)
        self._file: BinaryIO | None = None
        self._inode, self._at = -1, 0
        try:
            regular = stat.S_ISREG(self._path.stat().st_mode)
        except (OSError, ValueError) as error:
            found = getattr(error, "strerror", None) or str(error)
            problem = "the tracker's file cannot be read"
            raise InputError(problem, file=path, expected="a file that is being written", found=found) from None
        if not regular:
            raise InputError("this is not a file", file=path, expected="a file that is being written")
        self._first = True

    def read(self) -> Piece:
        try:
            return self._read()
        except OSError as error:
            self.close()
            time.sleep(POLL_S)
            raise SourceLost(f"{self.name}: {error.strerror or error}") from None

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def _read(self) -> Piece:
        if self._file is None:
            return self._open()
        data = self._file.read(PIECE)
        if data:
            self._at += len(data)
            return Piece(data)
        now = self._path.stat()
        if now.st_ino != self._inode:
            self.close()
            return self._open()
        if now.st_size < self._at:
            self._file.seek(0)
            self._at = 0
            return Piece(begins=True)
        time.sleep(POLL_S)
        return Piece()

    def _open(self) -> Piece:
        """Begins with the header; of a file found at the start, all complete lines after it are old and skipped."""
        self._file = self._path.open("rb", buffering=0)
        self._inode, self._at = os.fstat(self._file.fileno()).st_ino, 0
        first, self._first = self._first, False
        if not first:
            return Piece(begins=True)
        beginning = self._file.read(LONGEST_LINE)
        header_end = beginning.find(b"\n") + 1
        if header_end == 0:
            self._at = len(beginning)
            return Piece(beginning, begins=True)
        lines, end = _last_line_break(self._file, header_end)
        self._file.seek(end)
        self._at = end
        return Piece(beginning[:header_end], begins=True, skipped_lines=lines)


class TcpSource:
    """A server of lines. A lost connection is made anew, on the next reading."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port, self.name = host, port, f"{host}:{port}"
        self._socket: socket.socket | None = None

    def read(self) -> Piece:
        try:
            if self._socket is None:
                self._socket = socket.create_connection((self._host, self._port), CONNECT_S)
                self._socket.settimeout(POLL_S)
                return Piece(begins=True)
            data = self._socket.recv(PIECE)
        except TimeoutError:
            if self._socket is not None:
                return Piece()
            raise SourceLost(f"{self.name} does not answer") from None
        except OSError as error:
            self.close()
            time.sleep(POLL_S)
            raise SourceLost(f"{self.name}: {error.strerror or error}") from None
        if not data:
            self.close()
            raise SourceLost(f"{self.name} has closed the connection")
        return Piece(data)

    def close(self) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.close()
            self._socket = None


def _last_line_break(file: BinaryIO, start: int) -> tuple[int, int]:
    """How many lines end behind ``start``, and where the last of them ends (``start`` if none does)."""
    file.seek(start)
    lines, at, end = 0, start, start
    while data := file.read(1 << 20):
        count = data.count(b"\n")
        if count:
            lines += count
            end = at + data.rfind(b"\n") + 1
        at += len(data)
    return lines, end
