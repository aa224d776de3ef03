"""Process that stops a robot whose watcher was killed: ``python -m truepath.robot_link.guard_child HOST``.

It only waits: for ``{"do": "release"}``, or for the end or a long silence of its parent, after which it tells the
robot to stop. It has nothing of the client in it that could block or crash it.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import time

from truepath.robot_link.fault import RobotFault
from truepath.robot_link.interruptions import SIGNALS
from truepath.robot_link.pipes import Pipes
from truepath.robot_link.text_ports import STOP_PROGRAM, ask_dashboard, send_program

ANSWER_S, RETRY_S, LOOK_S = 2.0, 0.3, 0.2
TRIES_S = 3600.0  # a network may be away for long, and the program goes on meanwhile


class Watch:
    """What the parent has said last.

    Attributes:
        silent_from_s: when it counts as gone, although its pipe is open; None for never.
        starts_until_s: until then a program that was sent may still start.
        tries_s: for how long the robot is told to stop.
    """

    def __init__(self) -> None:
        self.silent_from_s: float | None = None
        self.starts_until_s, self.tries_s = 0.0, TRIES_S

    def hear(self, request: dict[str, float]) -> None:
        now_s = time.monotonic()
        if request.get("silence_s") is not None:
            self.silent_from_s = now_s + request["silence_s"]
        if request.get("starts_within_s") is not None:
            self.starts_until_s = now_s + request["starts_within_s"]
        if request.get("tries_s") is not None:
            self.tries_s = request["tries_s"]

    def require_life(self) -> None:
        """Raises TimeoutError."""
        if self.silent_from_s is not None and time.monotonic() > self.silent_from_s:
            raise TimeoutError


def main(host: str) -> None:
    """Says that it is there, then waits."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    pipes, watch = Pipes(), Watch()
    pipes.is_heard({"answer": True})
    with contextlib.suppress(TimeoutError):
        for request in pipes.requests(watch.require_life, LOOK_S):
            if request["do"] == "release":
                return
            watch.hear(request)
    stop(host, watch.starts_until_s, watch.tries_s)


def stop(host: str, starts_until_s: float, tries_s: float) -> None:
    """Tells a robot to stop by both text ports, until it says that no program runs, or has been told for long.

    Args:
        host: of the controller.
        starts_until_s: by ``time.monotonic()``; a program may start until then, and no earlier answer is believed.
        tries_s: after which it is given up.
    """
    end = time.monotonic() + tries_s
    is_told = False
    while time.monotonic() < end:
        is_idle = _is_idle(host)
        if is_idle and is_told and time.monotonic() >= starts_until_s:
            return
        # By the port that programs come by, too, once in any case: what was sent there before comes first.
        if not (is_idle and is_told):
            with contextlib.suppress(RobotFault):
                ask_dashboard(host, "stop", ANSWER_S)
            with contextlib.suppress(RobotFault):
                send_program(host, STOP_PROGRAM, ANSWER_S)
                is_told = True
        time.sleep(RETRY_S)


def _is_idle(host: str) -> bool:
    """Whether the robot says so; a paused program does not run, and is not over."""
    with contextlib.suppress(RobotFault):
        return ask_dashboard(host, "programState", ANSWER_S).upper().startswith("STOPPED")
    return False


if __name__ == "__main__":
    main(sys.argv[1])
