"""How a control script tells its client what an asynchronous move does: one register, several numbers in it.

Source: the comments of ur_rtde's control script (Lindvig et al., MIT licence): bits 24 to 30 count operations, 16 to 22
count writes, bit 15 is set while one runs, bits 0 to 14 are its progress.
"""

from __future__ import annotations

COUNTS = 128  # seven bits
MOST_PROGRESS = 32767


class ProgressRegister:
    """Its value after each event."""

    def __init__(self) -> None:
        self._writes, self._operations = 0, 0

    def started(self) -> int:
        """A new operation."""
        return self.reached(0)

    def reached(self, progress: int) -> int:
        """The running operation has come so far; 0 begins a new one."""
        if progress == 0:
            self._operations = (self._operations + 1) % COUNTS
        return self._written() | 1 << 15 | min(progress, MOST_PROGRESS)

    def finished(self) -> int:
        """No operation runs."""
        return self._written()

    def _written(self) -> int:
        self._writes = (self._writes + 1) % COUNTS
        return self._writes << 16 | self._operations << 24
