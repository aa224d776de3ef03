"""The simulated tracker's output: readings as lines of text over TCP. The line protocol is in ``recording.lines``."""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

from truepath.errors import InputError
from truepath.lie import Array
from truepath.recording.lines import BEAM_BREAK, POSITION_COLUMNS
from truepath.virtual.controller.addresses import checked_loopback

MOST_LISTENERS = 16


@dataclass(frozen=True, eq=False)
class Sight:
    """What the tracker sees: M is its frame, E the reflector.

    Attributes:
        time_s: clock of the tracker, real seconds from any zero.
        p_ME: ``(3,)`` m.
        visible: whether the beam reaches the reflector.
    """

    time_s: float
    p_ME: Array
    visible: bool


class TrackerStream:
    """Serves readings to whoever connects, in a thread of its own; a context manager.

    Whoever sends anything, or does not take what it is sent, is disconnected.

    Args:
        address: a loopback address.
        port: 0 for any free one, see ``port``.
        look: called for each reading, in the thread of the stream.
        rate_hz: readings a second.

    Raises:
        InputError: the address is not of this machine alone, or the port is taken.
    """

    def __init__(self, address: str, port: int, look: Callable[[], Sight], rate_hz: float = 100.0) -> None:
        checked_loopback(address)
        try:
            self._server = socket.create_server((address, port))
        except OSError as error:
            raise InputError(f"port {port} of {address} cannot be opened", found=error.strerror) from None
        self._server.setblocking(False)
        self.port: int = self._server.getsockname()[1]
        self._look, self._period_s = look, 1.0 / rate_hz
        self._listeners: dict[socket.socket, bool] = {}  # and whether each was told that the beam is broken
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._server, selectors.EVENT_READ)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def __enter__(self) -> TrackerStream:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Disconnects everybody and frees the port."""
        self._ended.set()
        self._thread.join()

    def _serve(self) -> None:
        due_s = time.monotonic()
        try:
            while not self._ended.is_set():
                due_s = max(due_s + self._period_s, time.monotonic())  # what was late is not made up for
                while (left_s := due_s - time.monotonic()) > 0 and not self._ended.is_set():
                    for key, _ in self._selector.select(left_s):
                        self._admit() if key.fileobj is self._server else self._drop(key.fileobj)  # type: ignore[arg-type]
                self._tell(self._look())
        finally:
            for listener in list(self._listeners):
                self._drop(listener)
            self._selector.close()
            self._server.close()

    def _admit(self) -> None:
        with contextlib.suppress(OSError):
            listener, _ = self._server.accept()
            if len(self._listeners) >= MOST_LISTENERS:
                listener.close()
                return
            listener.setblocking(False)
            self._listeners[listener] = False
            self._selector.register(listener, selectors.EVENT_READ)
            self._send(listener, ",".join(POSITION_COLUMNS))

    def _tell(self, sight: Sight) -> None:
        x, y, z = 1e3 * sight.p_ME
        reading = f"{sight.time_s:.6f},{x:.6f},{y:.6f},{z:.6f}"
        for listener, told in list(self._listeners.items()):
            if sight.visible or not told:
                self._listeners[listener] = not sight.visible
                self._send(listener, reading if sight.visible else BEAM_BREAK)

    def _send(self, listener: socket.socket, line: str) -> None:
        data = line.encode() + b"\n"
        try:
            if listener.send(data) == len(data):
                return
        except OSError:
            pass
        self._drop(listener)

    def _drop(self, listener: socket.socket) -> None:
        if self._listeners.pop(listener, None) is not None:
            self._selector.unregister(listener)
            listener.close()
