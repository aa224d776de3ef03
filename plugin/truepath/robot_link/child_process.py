"""The parent's end: a child process with JSON lines on its pipes, which can be killed at any moment."""

from __future__ import annotations

import contextlib
import fcntl
import json
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from truepath.robot_link.fault import RobotFault

Message = dict[str, Any]
PIPE_BYTES = 1 << 20  # some ten seconds of samples
LAST_WORDS = 400  # characters of what the client printed before it died


class ChildProcess:
    """A module of this package running as a process of its own.

    Args:
        module: its name, run with ``python -m``.
        arguments: of the process.
        on_message: called in a thread of its own with every message; without it messages wait for ``answer``.

    Attributes:
        gave_up_itself: it has answered with an error.
    """

    def __init__(self, module: str, arguments: list[str], on_message: Callable[[Message], None] | None = None) -> None:
        self._messages: queue.Queue[Message | None] = queue.Queue()
        self._on_message = on_message or self._messages.put
        self._printed = b""
        self.gave_up_itself = False
        # In a session of its own, so that Ctrl-C reaches the parent only, which then has the robot stopped.
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        assert self._process.stdout is not None
        with contextlib.suppress(OSError, AttributeError):  # room for what comes while this process has to wait
            fcntl.fcntl(self._process.stdout, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        for target in (self._listen, self._overhear):
            threading.Thread(target=target, daemon=True).start()

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    @property
    def pid(self) -> int:
        return self._process.pid

    def send(self, message: Message) -> None:
        """Raises RobotFault if the child has gone."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()
        except (OSError, ValueError):
            raise RobotFault(self.last_words()) from None

    def answer(self, timeout_s: float, question: str) -> Any:
        """The next answer of the child.

        Raises:
            RobotFault: an error of the client in its own words, none within the time (the child is then killed: it
                may be blocked for minutes), or the child died.
        """
        try:
            message = self._messages.get(timeout=timeout_s)
        except queue.Empty:
            self.kill()
            raise RobotFault(f"the robot did not answer in {timeout_s:.1f} s: {question}") from None
        if message is None:
            raise RobotFault(self.last_words())
        if "error" in message:
            self.gave_up_itself = True
            raise RobotFault(f"{question}: {message['error']}")
        return message["answer"]

    def last_words(self) -> str:
        """Why the child has gone, as far as it told."""
        printed = self._printed.decode("utf-8", "replace").strip().splitlines()
        code = self._process.poll()
        end = "" if code is None or code >= 0 else f" (killed by signal {-code})"
        return f"the client of the robot has gone{end}" + (f": {printed[-1].strip()}" if printed else "")

    def close(self, patience_s: float = 2.0) -> None:
        """Lets the child end by itself, for a while."""
        self.leave_alone()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(patience_s)
        self.kill()

    def leave_alone(self) -> None:
        """Closes the pipe to the child, which does what it does when its parent has gone."""
        with contextlib.suppress(OSError, ValueError):
            assert self._process.stdin is not None
            self._process.stdin.close()

    def kill(self) -> None:
        """Ends the child for sure; this process is not touched by whatever state it was in."""
        with contextlib.suppress(OSError):
            self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            with contextlib.suppress(OSError, ValueError):
                assert pipe is not None
                if pipe is self._process.stdin:
                    pipe.close()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with contextlib.suppress(ValueError, OSError):
            for line in self._process.stdout:
                self._on_message(json.loads(line))
        self._messages.put(None)

    def _overhear(self) -> None:
        """The client's prints must be read, or it blocks on a full pipe; only the end of them is kept."""
        assert self._process.stderr is not None
        with contextlib.suppress(ValueError, OSError):
            while printed := self._process.stderr.read1(4096):  # type: ignore[attr-defined]
                self._printed = (self._printed + printed)[-LAST_WORDS:]


def wait_for(condition: Callable[[], bool], timeout_s: float, every_s: float = 0.005) -> bool:
    """Whether a condition came true within a time."""
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() >= end:
            return False
        time.sleep(every_s)
    return True
