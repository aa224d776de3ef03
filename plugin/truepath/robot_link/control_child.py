"""Process that moves a robot with ``RTDEControlInterface``: ``python -m truepath.robot_link.control_child HOST``.

Moves are started, not waited for: the parent sees on the other stream when they are done, and this process stays free
to stop them. When the parent has gone, or does not watch a move, the robot is stopped.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Mapping
from typing import Any

from truepath.robot_link.parent_death import dying_with_parent
from truepath.robot_link.pipes import Pipes

STOP_RAD_S2 = 4.0
WATCHED_HZ, KICKED_EVERY_S = 1.0, 0.1
CONNECT_S, END_S = 60, 10  # the parent has lost its patience before, if there still is one


class Kicks:
    """Keeps the watchdog of the controller quiet, while somebody watches.

    Attributes:
        longest_s: between two kicks; time in which the computer was asleep counts.
    """

    def __init__(self, control: Any) -> None:
        self._control = control
        self._last_s, self.longest_s = _now_s(), 0.0
        self._heard_s, self._silence_s = 0.0, math.inf

    def hear(self, request: Mapping[str, Any]) -> None:
        """Takes note of what the parent says: whoever says something watches.

        Args:
            request: of a move with ``silence_s``, after which nobody watches.
        """
        self._heard_s = _now_s()
        if request["do"] in ("arrived", "stop"):
            self._silence_s = math.inf
        self._silence_s = request.get("silence_s", self._silence_s)

    def kick(self) -> None:
        """Raises TimeoutError if nobody watches the move."""
        if _now_s() > self._heard_s + self._silence_s:
            raise TimeoutError(f"nobody has watched the move for {self._silence_s:.0f} s")
        self.look()
        self._control.kickWatchdog()
        self._last_s = _now_s()

    def look(self) -> None:
        self.longest_s = max(self.longest_s, _now_s() - self._last_s)


def main(host: str) -> None:
    """Answers each request ``{"do": ...}`` with ``{"answer": value}`` or ``{"error": words}``.

    ``watched`` and ``arrived`` have no answer.
    """
    pipes = Pipes()
    try:
        from rtde_control import RTDEControlInterface  # type: ignore[import-not-found]

        # What this process does meanwhile it cannot look after: a script that is sent late has nobody to end it.
        with dying_with_parent(), pipes.at_most(CONNECT_S):
            control = RTDEControlInterface(host)
    except Exception as error:  # the client throws whatever it likes
        pipes.say({"error": str(error) or type(error).__name__})
        os._exit(1)
    control.setWatchdog(WATCHED_HZ)  # a robot whose client is silent for longer stops by itself
    closed = False
    try:
        closed = _serve(control, pipes)
    except TimeoutError as silence:
        print(silence, file=sys.stderr, flush=True)
    try:
        with pipes.at_most(END_S):
            if not closed:
                control.stopJ(STOP_RAD_S2)
            control.stopScript()
            control.disconnect()
    finally:
        os._exit(0)


def _serve(control: Any, pipes: Pipes) -> bool:
    """Until the parent has gone; whether it has said that it goes. Raises TimeoutError if it does not watch a move."""
    kicks = Kicks(control)
    if not pipes.is_heard({"answer": True}):
        return False
    for request in pipes.requests(kicks.kick, KICKED_EVERY_S):
        what = request["do"]
        kicks.hear(request)
        if what == "close":
            return True
        if what in ("watched", "arrived"):
            continue
        try:
            answer = {"answer": _do(control, request, kicks)}
        except Exception as error:
            answer = {"error": str(error) or type(error).__name__}
        if not pipes.is_heard(answer):
            break
    return False


def _do(control: Any, request: Mapping[str, Any], kicks: Kicks) -> Any:
    if request["do"] == "move_joints":
        return control.moveJ(request["to"], request["speed"], request["acceleration"], True)
    if request["do"] == "move_line":
        return control.moveL(request["to"], request["speed"], request["acceleration"], True)
    if request["do"] == "stop":
        control.stopJ(STOP_RAD_S2)
        return True
    if request["do"] == "tcp_offset":
        return control.getTCPOffset()
    if request["do"] == "lateness":
        kicks.look()
        return kicks.longest_s
    raise ValueError(f"no such request: {request['do']}")


def _now_s() -> float:
    return time.clock_gettime(getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))


if __name__ == "__main__":
    main(sys.argv[1])
