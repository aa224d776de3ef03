"""``truepath record`` as a process that can be killed, with its children."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

LONGEST_S = 90.0  # a recording of a few poses that takes longer hangs


class Recorder:
    """The command on ``poses.csv`` of a folder; writes ``data.csv`` there.

    Args:
        folder: with the list.
        address: of the controller.
    """

    def __init__(self, folder: Path, address: str) -> None:
        self._command = [
            *(sys.executable, "-c", "from truepath.cli import main; main()", "record", str(folder / "poses.csv")),
            *("--robot-host", address, "--tracker", "simulated", "-o", str(folder / "data.csv"), "--yes"),
            *("--first-move-deg", "360"),  # nothing stands in the way of a virtual robot
            *("--settle-s", "0.1", "--measure-s", "0.1", "--speed-deg", "40", "--acceleration-deg", "120"),
        ]
        self._log = folder / "log.txt"
        self.data = folder / "data.csv"
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, *more: str) -> None:
        with self._log.open("ab") as log:
            self._process = subprocess.Popen([*self._command, *more], stdout=log, stderr=log)

    def wait_for_rows(self, count: int) -> None:
        """Until so many rows are on the disk, or the command has ended."""
        assert self._process is not None
        end = time.monotonic() + LONGEST_S
        while self._process.poll() is None and time.monotonic() < end:
            if count == 0 or (self.data.exists() and self.data.read_bytes().count(b"\n") > count):
                return
            time.sleep(0.005)

    def wait(self) -> int | None:
        """The exit code; None if it hung, and was killed."""
        assert self._process is not None
        try:
            return self._process.wait(LONGEST_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return None

    def end(self, number: signal.Signals) -> None:
        """Sends a signal, if it still runs."""
        assert self._process is not None
        if self._process.poll() is None:
            self._process.send_signal(number)

    def child(self, name: str) -> int | None:
        """Process number of one of its children, by a part of its command line."""
        assert self._process is not None
        for status in Path("/proc").glob("[0-9]*/stat"):
            try:
                parent = int(status.read_text().rpartition(")")[2].split()[1])
                if parent == self._process.pid and name in (status.parent / "cmdline").read_text():
                    return int(status.parent.name)
            except OSError:  # it has ended meanwhile
                continue
        return None

    def last_words(self) -> str:
        return self._log.read_text(errors="replace")[-600:]
