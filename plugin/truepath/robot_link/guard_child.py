"""Process that stops a robot whose watcher was killed: ``python -m truepath.robot_link.guard_child HOST``.

It only waits: for ``{"do": "release"}``, or for the end of its parent, after which it tells the robot to stop. It has
nothing of the client in it that could block or crash it.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import time

from truepath.robot_link.fault import RobotFault
from truepath.robot_link.interruptions import SIGNALS
from truepath.robot_link.pipes import Pipes
from truepath.robot_link.stopping import STOP_PROGRAM
from truepath.robot_link.text_ports import ask_dashboard, send_program

ANSWER_S, TRIED_S, RETRY_S = 2.0, 20.0, 0.3


def main(host: str) -> None:
    """Says that it is there, then waits."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    pipes = Pipes()
    pipes.say({"answer": True})
    for request in pipes.requests():
        if request["do"] == "release":
            return
    stop(host)


def stop(host: str) -> None:
    """Tells a robot to stop by both text ports, until it says that no program runs, or has been told for long."""
    end = time.monotonic() + TRIED_S
    while time.monotonic() < end:
        with contextlib.suppress(RobotFault):
            ask_dashboard(host, "stop", ANSWER_S)
        if _is_idle(host):
            return
        with contextlib.suppress(RobotFault):
            send_program(host, STOP_PROGRAM, ANSWER_S)
        time.sleep(RETRY_S)
        if _is_idle(host):
            return


def _is_idle(host: str) -> bool:
    """Whether the robot says so; a paused program does not run, and is not over."""
    with contextlib.suppress(RobotFault):
        return ask_dashboard(host, "programState", ANSWER_S).upper().startswith("STOPPED")
    return False


if __name__ == "__main__":
    main(sys.argv[1])
