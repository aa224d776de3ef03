"""Process that moves a robot with ``RTDEControlInterface``: ``python -m truepath.robot_link.control_child HOST``.

Moves are started, not waited for: the parent sees on the other stream when they are done, and this process stays free
to stop them. When the parent has gone the robot is stopped.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from typing import Any

from truepath.robot_link.pipes import Pipes

STOP_RAD_S2 = 4.0
CONNECT_S, END_S = 60, 10  # the parent has lost its patience before, if there still is one


def main(host: str) -> None:
    """Answers each request ``{"do": ...}`` with ``{"answer": value}`` or ``{"error": words}``."""
    pipes = Pipes()
    try:
        from rtde_control import RTDEControlInterface  # type: ignore[import-not-found]

        with pipes.at_most(CONNECT_S):
            control = RTDEControlInterface(host)
    except Exception as error:  # the client throws whatever it likes
        pipes.say({"error": str(error) or type(error).__name__})
        os._exit(1)
    pipes.say({"answer": True})
    closed = False
    for request in pipes.requests():
        closed = request["do"] == "close"
        if closed:
            break
        try:
            pipes.say({"answer": _do(control, request)})
        except Exception as error:
            pipes.say({"error": str(error) or type(error).__name__})
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
