"""A virtual controller in this process, for a person who stands before it."""

from __future__ import annotations

import asyncio
import re
import signal
from collections.abc import Callable, Sequence

from truepath.errors import InputError
from truepath.virtual.controller.addresses import DASHBOARD_PORT, RTDE_PORT, SCRIPT_PORT
from truepath.virtual.controller.faults import FAULTS, schedule
from truepath.virtual.controller.options import ControllerOptions
from truepath.virtual.controller.precise_loop import run_precisely
from truepath.virtual.controller.service import Service

NUMBER = r"(\d+(?:\.\d*)?|\.\d+)"


def stated_fault(text: str) -> tuple[str, float, float | None]:
    """A fault as written on the command line, ``NAME:AFTER_S`` or ``NAME:AFTER_S:FOR_S``.

    Raises:
        InputError: not of that form, or no such fault.
    """
    found = re.fullmatch(rf"(\w+):{NUMBER}(?::{NUMBER})?", text)
    if found is None or found[1] not in FAULTS:
        raise InputError(
            "no such fault", expected=f"NAME:AFTER_S or NAME:AFTER_S:FOR_S, NAME being {', '.join(FAULTS)}", found=text
        )
    return found[1], float(found[2]), None if found[3] is None else float(found[3])


def run_in_foreground(
    options: ControllerOptions, faults: Sequence[tuple[str, float, float | None]], say: Callable[[str], None]
) -> None:
    """Until somebody interrupts it.

    Args:
        options: of the controller.
        faults: as of ``stated_fault``; counted from when the ports are open.
        say: tells a person what can be reached where.

    Raises:
        InputError: options that cannot be, or a port that is taken.
    """
    run_precisely(_run(Service(options), faults, say))


async def _run(service: Service, faults: Sequence[tuple[str, float, float | None]], say: Callable[[str], None]) -> None:
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    await service.open()
    try:
        for fault in faults:
            schedule(service, *fault)
        options = service.options
        say(f"RTDE       {options.address}:{RTDE_PORT}")
        say(f"dashboard  {options.address}:{DASHBOARD_PORT}")
        say(f"scripts    {options.address}:{SCRIPT_PORT}")
        say(f"tracker    {options.address}:{options.tracker_port}")
        await ended.wait()
    finally:
        service.close()
