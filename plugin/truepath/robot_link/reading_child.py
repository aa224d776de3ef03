"""Process that reads a robot with ``RTDEReceiveInterface``: ``python -m truepath.robot_link.reading_child HOST RATE``.

Every packet of the controller becomes one sample on standard output. The client has no queue, only the newest packet:
it is looked at several times in each period.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from truepath.robot_link.pipes import Pipes

LOOKS_PER_PERIOD = 6
BATCH_S = 0.010  # samples go to the parent in handfuls: fewer lines to take apart
CONNECTION_CHECK_S = 0.1
CONNECT_S = 60  # the parent has lost its patience before


def main(host: str, rate_hz: float) -> None:
    """Sends ``{"samples": [...]}`` until the parent or the robot has gone; ``{"error": words}`` says which fault."""
    pipes = Pipes()
    threading.Thread(target=_end_with_parent, args=(pipes,), daemon=True).start()
    _come_first()
    try:
        from rtde_receive import RTDEReceiveInterface  # type: ignore[import-not-found]

        with pipes.at_most(CONNECT_S):
            receive = RTDEReceiveInterface(host, rate_hz)
        pipes.say({"connected": True})
        _follow(receive, pipes, 1.0 / rate_hz / LOOKS_PER_PERIOD)
    except Exception as error:  # the client throws whatever it likes
        pipes.say({"error": str(error) or type(error).__name__})
    os._exit(1)  # the client's destructor can block on a controller that has gone


def _end_with_parent(pipes: Pipes) -> None:
    for _ in pipes.requests():
        pass
    os._exit(0)


def _come_first() -> None:
    """Real-time priority, where the system grants it: on a busy machine samples would be missed else."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except (OSError, AttributeError):
        with contextlib.suppress(OSError):
            os.nice(-10)


def _follow(receive: Any, pipes: Pipes, pause_s: float) -> None:
    newest, batch, sent_s, checked_s = None, [], time.monotonic(), time.monotonic()
    while True:
        time_s, now_s = receive.getTimestamp(), time.monotonic()
        if time_s != newest and time_s > 0:
            sample = _sample(receive, time_s)
            if receive.getTimestamp() == time_s:  # else two packets are mixed in it: look again
                newest = time_s
                batch.append(sample)
        else:
            time.sleep(pause_s)
        if batch and now_s - sent_s >= BATCH_S:
            pipes.say({"samples": batch})
            batch, sent_s = [], now_s
        if now_s - checked_s >= CONNECTION_CHECK_S:
            checked_s = now_s
            if not receive.isConnected():
                pipes.say({"samples": batch})
                raise ConnectionError("the connection to the robot was lost")


def _sample(receive: Any, time_s: float) -> dict[str, Any]:
    return {
        "time_s": time_s,
        "arrived_s": time.monotonic(),
        "q": receive.getActualQ(),
        "q_target": receive.getTargetQ(),
        "speed": receive.getActualQd(),
        "temperatures": receive.getJointTemperatures(),
        "tcp_pose": receive.getActualTCPPose(),
        "robot_mode": receive.getRobotMode(),
        "safety_mode": receive.getSafetyMode(),
        "safety_bits": receive.getSafetyStatusBits(),
        "runtime_state": receive.getRuntimeState(),
        "speed_fraction": receive.getTargetSpeedFraction(),
        "payload_kg": _told(receive.getPayload),
        "payload_cog_m": _told(receive.getPayloadCog),
    }


def _told(getter: Callable[[], Any]) -> Any:
    """What only newer controllers tell, else None."""
    try:
        return getter()
    except Exception:
        return None


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
