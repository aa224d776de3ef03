"""An event loop whose timers are exact to some microseconds."""

from __future__ import annotations

import asyncio
import gc
import selectors
import sys
from collections.abc import Coroutine
from typing import Any

SWITCH_S = 0.0005  # between threads: the tracker's must not make a package late


def run_precisely(work: Coroutine[Any, Any, None]) -> None:
    """As ``asyncio.run``. The usual loop waits in whole milliseconds, too coarse for packages every two of them."""
    loop = asyncio.SelectorEventLoop(selectors.SelectSelector())
    usual_s = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    gc.collect()
    gc.freeze()  # what is there now stays: looking through it again and again would take tens of milliseconds
    try:
        asyncio.set_event_loop(loop)
        loop.run_until_complete(work)
    finally:
        left = asyncio.all_tasks(loop)
        for task in left:
            task.cancel()
        loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
        asyncio.set_event_loop(None)
        loop.close()
        sys.setswitchinterval(usual_s)
        gc.unfreeze()
