"""What a robot says, as it comes from the reading child, which is started when it is needed."""

from __future__ import annotations

import threading
import time
from collections import deque

from truepath.robot_link.child_process import ChildProcess, Message, wait_for
from truepath.robot_link.fault import RobotFault
from truepath.robot_link.state import ENDED, PLAYING

KEPT_S = 120
POLL_S = 0.002


class Reading:
    """The samples of a robot.

    Args:
        host: address of the controller.
        rate_hz: of the samples.

    Attributes:
        plays_since_s: since when a program has been playing without a break, by ``time.monotonic()``; None if none is.
        began_s: when a program began last where there was none; None if none has.
        first_began_s: the first such moment since ``expect_program``.
    """

    def __init__(self, host: str, rate_hz: float) -> None:
        self._host, self._rate_hz = host, rate_hz
        self._samples: deque[Message] = deque(maxlen=int(KEPT_S * rate_hz))
        self._lock = threading.Lock()
        self._newest: Message | None = None
        self._fault: str | None = None
        self._child: ChildProcess | None = None
        self.plays_since_s: float | None = None
        self.began_s: float | None = None
        self.first_began_s: float | None = None
        self._runs = False

    @property
    def is_on(self) -> bool:
        """Whether the child is there; a read would start it otherwise, which takes a while."""
        return self._child is not None and self._child.alive

    @property
    def pid(self) -> int | None:
        return None if self._child is None else self._child.pid

    def newest(self, within_s: float, start_s: float) -> Message:
        """The first sample that arrives after the call.

        Args:
            within_s: it must arrive.
            start_s: for which the child may take to start.

        Raises:
            RobotFault: none does.
        """
        self._start(start_s)
        asked_s = time.monotonic()
        if not wait_for(lambda: self._is_after(asked_s) or self._is_lost(), within_s, POLL_S) or self._is_lost():
            raise RobotFault(f"{self._host}: {self._fault or f'no data from the robot for {within_s:.1f} s'}")
        assert self._newest is not None
        return self._newest

    def take(self, start_s: float) -> list[Message]:
        """All samples since the last call, of the last two minutes at most; empty when the robot sends nothing."""
        self._start(start_s)
        with self._lock:
            taken = list(self._samples)
            self._samples.clear()
        return taken

    def expect_program(self) -> None:
        """To be said before one is sent; see ``first_began_s``."""
        self.first_began_s = None

    def close(self) -> None:
        """Ends the child."""
        child, self._child = self._child, None
        if child is not None:
            child.kill()

    def _start(self, start_s: float) -> None:
        if self.is_on:
            return
        self._newest, self._fault = None, None
        arguments = [self._host, str(self._rate_hz)]
        child = ChildProcess("truepath.robot_link.reading_child", arguments, self._receive)
        self._child = child
        if not wait_for(lambda: self._newest is not None or self._is_lost(), start_s):
            child.kill()
            raise RobotFault(f"{self._host} does not answer: no data within {start_s:.0f} s")
        if self._is_lost():
            raise RobotFault(f"{self._host} cannot be read: {self._fault or child.last_words()}")

    def _receive(self, message: Message) -> None:
        if "error" in message:
            self._fault = str(message["error"])
        for sample in message.get("samples", ()):
            with self._lock:
                self._samples.append(sample)
            self._note_program(int(sample["runtime_state"]), float(sample["arrived_s"]))
            self._newest = sample

    def _note_program(self, runtime_state: int, arrived_s: float) -> None:
        if runtime_state != PLAYING:
            self.plays_since_s = None
        elif self.plays_since_s is None:
            self.plays_since_s = arrived_s
        runs = runtime_state not in ENDED
        if runs and not self._runs:
            self.began_s = arrived_s
            if self.first_began_s is None:
                self.first_began_s = arrived_s
        self._runs = runs

    def _is_after(self, moment_s: float) -> bool:
        return self._newest is not None and self._newest["arrived_s"] > moment_s

    def _is_lost(self) -> bool:
        return self._fault is not None or not self.is_on
