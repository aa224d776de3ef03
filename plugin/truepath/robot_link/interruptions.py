"""Signals of a person who wants an end: Ctrl-C, a closed terminal, ``kill``. They must not cut a stop short.

Ctrl-Z is one of them: a process that is suspended watches no robot.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGTSTP") if hasattr(signal, name))


@contextmanager
def interruptible() -> Iterator[None]:
    """Within, the first of the signals is a ``KeyboardInterrupt``; further ones, while it is dealt with, are nothing.

    Jobs in the background inherit to ignore Ctrl-C, and get it back here. A closed terminal stays ignored for who has
    asked for that (``nohup``).
    """
    with _handled(_interrupt):
        yield


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Within, the signals are nothing: for what takes a limited time and must be done."""
    with _handled(_ignore):
        yield


@contextmanager
def deferred() -> Iterator[None]:
    """Within, the signals wait until the body is done, which must take a limited time."""
    late: list[int] = []
    with _handled(lambda number, frame: late.append(number)):
        yield
    if late:
        signal.raise_signal(late[0])


@contextmanager
def ending_at_once() -> Iterator[None]:
    """Within, the signals end the process: while libraries load, an interruption can get lost in them, or look like a
    broken installation.
    """
    with _handled(signal.SIG_DFL):
        yield


@contextmanager
def _handled(handler: Callable[[int, Any], Any] | signal.Handlers) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():  # signals do not come here
        yield
        return
    before = {number: signal.getsignal(number) for number in _ours()}
    try:
        for number in before:
            signal.signal(number, handler)
        yield
    finally:
        for number, old in before.items():
            if old is not None:  # else it was not set by Python
                signal.signal(number, old)


def _ours() -> list[signal.Signals]:
    unhung = getattr(signal, "SIGHUP", None)
    return [number for number in SIGNALS if number != unhung or signal.getsignal(number) is not signal.SIG_IGN]


def _interrupt(number: int, frame: Any) -> NoReturn:
    for each in _ours():
        signal.signal(each, _ignore)
    raise KeyboardInterrupt


def _ignore(number: int, frame: Any) -> None:
    """A function, not SIG_IGN, which children would inherit."""
