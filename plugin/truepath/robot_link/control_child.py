"""Process that moves a robot with ``RTDEControlInterface``: ``python -m truepath.robot_link.control_child HOST``.

Moves are started, not waited for: the parent sees on the other stream when they are done, and this process stays free
to stop them. When the parent has gone the robot is stopped.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from typing import Any

from truepath.robot_link.parent_death import dying_with_parent
from truepath.robot_link.pipes import Pipes

STOP_RAD_S2 = 4.0
WATCHED_HZ, KICKED_EVERY_S = 1.0, 0.1
CONNECT_S, END_S = 60, 10  # the parent has lost its patience before, if there still is one


def main(host: str) -> None:
    """Answers each request ``{"do": ...}`` with ``{"answer": value}`` or ``{"error": words}``."""
    pipes = Pipes()
    try:
        from rtde_control import RTDEControlInterface  # type: ignore[import-not-found]

        # What this process does meanwhile it cannot look after: a script that is sent late has nobody to end it.
        with dying_with_parent(), pipes.at_most(CONNECT_S):
            control = RTDEControlInterface(host)
    except Exception as error:  # the client throws whatever it likes
        pipes.say({"error": str(error) or type(error).__name__})
        os._exit(1)
    closed, heard = False, pipes.is_heard({"answer": True})
    control.setWatchdog(WATCHED_HZ)  # a robot whose client is silent for longer stops by itself
    for request in pipes.requests(control.kickWatchdog, KICKED_EVERY_S) if heard else ():
        closed = request["do"] == "close"
        if closed:
            break
        try:
            answer = {"answer": _do(control, request)}
        except Exception as error:
            answer = {"error": str(error) or type(error).__name__}
        if not pipes.is_heard(answer):
            break
    try:
        with pipes.at_most(END_S):
            if not closed:
                control.stopJ(STOP_RAD_S2)
            control.stopScript()
            control.disconnect()
    finally:
        os._exit(0)


def _do(control: Any, request: Mapping[str, Any]) -> Any:
    if request["do"] == "move_joints":
        return control.moveJ(request["to"], request["speed"], request["acceleration"], True)
    if request["do"] == "move_line":
        return control.moveL(request["to"], request["speed"], request["acceleration"], True)
    if request["do"] == "stop":
        control.stopJ(STOP_RAD_S2)
        return True
    if request["do"] == "tcp_offset":
        return control.getTCPOffset()
    raise ValueError(f"no such request: {request['do']}")


if __name__ == "__main__":
    main(sys.argv[1])
