"""The tool that a controller is set to."""

from __future__ import annotations

import time

import numpy as np

from truepath.lie import Array
from truepath.robot_link.fault import RobotFault
from truepath.robot_link.link import RobotLink

QUIET_S = 5.0
POLL_S = 0.02


def tcp_on_controller(link: RobotLink) -> Array:
    """``(6,)`` X_0T, m and rotation vector. Only a control script tells; it has ended when this returns.

    Raises:
        RobotFault: it does not tell, or its program does not end.
    """
    with RobotLink(link.host, link.timeout_s) as asking:
        tcp = asking.tcp_offset()
    if not np.isfinite(tcp).all():
        raise RobotFault("the controller does not tell its TCP in numbers")
    end = time.monotonic() + QUIET_S
    while link.state().program_running:
        if time.monotonic() > end:
            raise RobotFault("the program that was asked for the TCP does not end")
        time.sleep(POLL_S)
    return tcp
