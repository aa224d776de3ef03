"""Faults on demand. Times are the wall's: a cable does not know how fast a robot lives."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from truepath.errors import InputError

if TYPE_CHECKING:
    from truepath.virtual.controller.service import Service

MOST_WAIT_S = 24 * 3600.0


def _protective_stop(service: Service, for_s: float) -> None:
    service.machine.protective_stop("a fault on demand")


def _emergency_stop(service: Service, for_s: float) -> None:
    service.machine.emergency_stop()


def _connection_lost(service: Service, for_s: float) -> None:
    service.disconnect(for_s)


def _restart(service: Service, for_s: float) -> None:
    service.machine.restart()
    service.disconnect(for_s)


def _late(service: Service, for_s: float) -> None:
    service.weather.make_late(for_s)


def _missing(service: Service, for_s: float) -> None:
    service.weather.lose(for_s)


def _beam_break(service: Service, for_s: float) -> None:
    service.eye.break_beam(for_s)


# How long each lasts unless something else is said; protective and emergency stop last until somebody ends them.
FAULTS: dict[str, tuple[Callable[[Service, float], None], float]] = {
    "protective_stop": (_protective_stop, 0.0),
    "emergency_stop": (_emergency_stop, 0.0),
    "connection_lost": (_connection_lost, 1.0),
    "late_packets": (_late, 5.0),
    "missing_packets": (_missing, 5.0),
    "beam_break": (_beam_break, 2.0),
    "restart": (_restart, 3.0),
}


def schedule(service: Service, name: str, after_s: float = 0.0, for_s: float | None = None) -> asyncio.TimerHandle:
    """Lets a fault happen later, on the running event loop.

    Raises:
        InputError: no such fault, or times that are none.
    """
    if name not in FAULTS:
        raise InputError(f"no fault {name!r}", expected="one of " + ", ".join(FAULTS))
    happen, usual_s = FAULTS[name]
    lasts = usual_s if for_s is None else for_s
    for seconds in (after_s, lasts):
        if not (math.isfinite(seconds) and 0 <= seconds <= MOST_WAIT_S):
            raise InputError("no time for a fault", expected="seconds from 0 on", found=str(seconds))
    return asyncio.get_running_loop().call_later(after_s, happen, service, lasts)
