"""The child's end of the pipes to its parent: JSON lines, safe from whatever ur_rtde prints."""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO


class Pipes:
    """Standard input and output of a child. What a C++ library prints afterwards goes to standard error."""

    def __init__(self) -> None:
        self._answers: TextIO = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    @contextmanager
    def at_most(self, seconds: int) -> Iterator[None]:
        """Ends the process if what is done here takes longer: the client may block, and hold Python's lock, for ever.

        The signal is not handled by Python, which may never get to it.
        """
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(seconds)
        yield
        signal.alarm(0)

    def say(self, message: dict[str, Any]) -> None:
        """Sends a message. Ends the process if the parent has gone: nobody is left to work for."""
        if not self.is_heard(message):
            os._exit(0)

    def is_heard(self, message: dict[str, Any]) -> bool:
        """Sends a message; whether there still is somebody to read it."""
        try:
            self._answers.write(json.dumps(message) + "\n")
            self._answers.flush()
        except (BrokenPipeError, ValueError):
            return False
        return True

    def requests(
        self, meanwhile: Callable[[], Any] = lambda: None, every_s: float | None = None
    ) -> Iterator[dict[str, Any]]:
        """What the parent asks for, until it closes the pipe or dies.

        Args:
            meanwhile: called between requests, however many there are.
            every_s: how often; None for never.
        """
        unread, called_s = b"", time.monotonic()
        while True:
            left_s = None if every_s is None else max(0.0, called_s + every_s - time.monotonic())
            if select.select([sys.stdin], [], [], left_s)[0]:
                part = os.read(sys.stdin.fileno(), 65536)
                if not part:
                    return
                *lines, unread = (unread + part).split(b"\n")
                yield from (json.loads(line) for line in lines)
            if every_s is not None and time.monotonic() >= called_s + every_s:
                called_s = time.monotonic()
                meanwhile()
