"""A child that must not outlive its parent while it cannot look after itself (Linux; elsewhere nothing happens)."""

from __future__ import annotations

import ctypes
import os
import select
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

PR_SET_PDEATHSIG = 1


@contextmanager
def dying_with_parent() -> Iterator[None]:
    """Within, the system kills this process the moment that its parent ends, whatever a library does meanwhile."""
    tell = _prctl(signal.SIGKILL)
    end_if_alone()
    yield
    if tell:
        _prctl(0)


def end_if_alone() -> None:
    """Ends the process if nobody holds the other end of its standard input any more."""
    poll = select.poll()
    poll.register(sys.stdin.fileno(), select.POLLHUP)
    if any(event & select.POLLHUP for _, event in poll.poll(0)):
        os._exit(0)


def _prctl(number: int) -> bool:
    if not sys.platform.startswith("linux"):
        return False
    return ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, number, 0, 0, 0) == 0
