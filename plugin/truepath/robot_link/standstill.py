"""Waiting until a robot stands still. Right after a move the actual joints may be those of the way there."""

from __future__ import annotations

import time

import numpy as np

from truepath.robot_link.fault import RobotFault
from truepath.robot_link.link import RobotLink
from truepath.robot_link.state import RobotState

STILL_RAD_S = 0.005
STILL_RAD = 1e-4  # from the lowest to the highest reading of a joint: 0.1 mm at arm's length
ON_TARGET_RAD = 3e-3  # gravity holds a joint a little off for good


def wait_until_still(link: RobotLink, settle_s: float, timeout_s: float) -> list[RobotState]:
    """The samples of ``settle_s`` seconds in which the robot stood still.

    Raises:
        RobotFault: it does not come to rest within the time, or is lost.
    """
    link.samples()  # what is older than the call does not count
    window: list[RobotState] = []
    end = time.monotonic() + settle_s + timeout_s
    while time.monotonic() < end:
        latest = link.state()
        if not latest.able_to_move:
            raise RobotFault(f"the robot stopped: safety status {latest.safety.replace('_', ' ')}")
        for state in link.samples():
            window = [*window, state] if _is_at_rest(state) else []
        while window and _reach(window) > STILL_RAD:
            window.pop(0)
        if len(window) > 1 and window[-1].arrived_s - window[0].arrived_s >= settle_s:
            return window
        time.sleep(0.01)
    raise RobotFault(f"the robot does not come to rest: not still for {settle_s:.2f} s within {timeout_s:.0f} s")


def _is_at_rest(state: RobotState) -> bool:
    on_target = np.abs(state.q_rad - state.q_target_rad).max() < ON_TARGET_RAD
    return bool(on_target and np.abs(state.speed_rad_s).max() < STILL_RAD_S)


def _reach(window: list[RobotState]) -> float:
    return float(np.ptp([state.q_rad for state in window], axis=0).max())
