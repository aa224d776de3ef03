"""Bringing a robot to rest. That something was told to stop is no sign that it stands: it is watched until it does."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from truepath.robot_link.fault import RobotFault
from truepath.robot_link.state import RobotState

STANDS_RAD_S = 0.01
STANDS_RAD = 2e-3  # from the lowest to the highest reading of a joint
STANDS_FOR_S = 0.3
LEAST_SAMPLES = 5
OBEYS_WITHIN_S = 1.2  # a way that has shown nothing by then has failed, and the next one is tried
RESTS_WITHIN_S = 3.0  # once no program runs any more
STOPS_ITSELF_S = 0.2  # the program that only stops; another one that has started since goes on for longer
RETRY_S = 0.1

Way = tuple[str, Callable[[], str]]


class Rest:
    """Whether a robot stands, by its samples: no program, no speed and the same joints for a while."""

    def __init__(self) -> None:
        self._window: list[RobotState] = []

    def take(self, state: RobotState) -> bool:
        """Whether the robot has stood up to this sample, which is the newest."""
        slow = (np.abs(state.speed_rad_s) <= STANDS_RAD_S).all()  # a NaN is no robot that stands
        if state.program_running or not slow or not np.isfinite(state.q_rad).all():
            self._window = []
            return False
        self._window.append(state)
        while np.ptp([each.q_rad for each in self._window], axis=0).max() > STANDS_RAD:
            self._window.pop(0)
        long_enough = self._window[-1].arrived_s - self._window[0].arrived_s >= STANDS_FOR_S
        return long_enough and len(self._window) >= LEAST_SAMPLES


def bring_to_rest(
    look: Callable[[], RobotState], ways: Sequence[Way], limit_s: float, may_start: Callable[[], bool] = lambda: False
) -> None:
    """Tries one way after the other, over and over, until the robot is seen to stand without a program.

    Args:
        look: gives a sample that is newer than the call.
        ways: names, and functions that tell the robot to stop and say what it answered.
        limit_s: no way is begun later, counted from when no program may start any more.
        may_start: whether a program that was sent may still start; rest is not the end of it then.

    Raises:
        RobotFault: it was not seen to stand within the time; says what is known.
    """
    end, turn = time.monotonic() + limit_s, 0
    answers: dict[str, str] = {}
    while True:
        name, tell = ways[turn % len(ways)]
        try:
            answers[name] = tell()
        except RobotFault as fault:
            answers[name] = fault.reason
        seen = _watch(look, may_start)
        if seen is None:
            return
        if may_start():
            end = time.monotonic() + limit_s
        elif time.monotonic() >= end:
            told = "; ".join(f"{way}: {answer or 'told'}" for way, answer in answers.items())
            raise RobotFault(f"{seen} ({told})")
        turn += 1
        time.sleep(RETRY_S)


def _watch(look: Callable[[], RobotState], may_start: Callable[[], bool]) -> str | None:
    """None when the robot stands, else what is seen of it in the end."""
    rest, began_s, has_rested = Rest(), time.monotonic(), False
    while True:
        try:
            state = look()
        except RobotFault as fault:
            return f"it cannot be seen, so that whether it still moves is not known: {fault.reason}"
        if rest.take(state):
            if not may_start():
                return None
            has_rested, began_s = True, time.monotonic()
        obeys_s = STOPS_ITSELF_S if has_rested else OBEYS_WITHIN_S
        within_s = obeys_s if state.program_running else RESTS_WITHIN_S
        if time.monotonic() - began_s > within_s:
            slow = (np.abs(state.speed_rad_s) <= STANDS_RAD_S).all()
            return ("it stands for now" if slow else "it still moves") + (
                ", and its program has not ended" if state.program_running else ""
            )
