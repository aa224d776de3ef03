"""What happens to a recording."""

from __future__ import annotations

import contextlib
import os
import signal
import time

import numpy as np
from truepath.virtual.controller.process import ControllerProcess

from recording_faults.recorder import Recorder

FAULTS = (
    "protective_stop",
    "emergency_stop",
    "connection_lost",
    "restart",
    "late_packets",
    "missing_packets",
    "beam_break",
)
SIGNALS = {"kill": signal.SIGKILL, "interrupt": signal.SIGINT, "terminate": signal.SIGTERM, "tear": signal.SIGKILL}
CHILDREN = {"kill_control": "control_child", "kill_reading": "reading_child"}
DISTURBANCES = (*FAULTS, *SIGNALS, *CHILDREN)
CHILD_APPEARS_S = 5.0


def disturb(kind: str, after_s: float, for_s: float, recorder: Recorder, controller: ControllerProcess) -> None:
    """Lets it happen, so many seconds from now; faults of the controller last ``for_s``. ``tear`` also tears a row."""
    if kind in FAULTS:
        controller.command({"do": "fault", "name": kind, "after_s": after_s, "for_s": for_s})
        return
    time.sleep(after_s)
    if kind in CHILDREN:
        _kill_child(CHILDREN[kind], recorder)
        return
    recorder.end(SIGNALS[kind])
    if kind == "tear":
        recorder.wait()
        _tear(recorder, np.random.default_rng(round(1e6 * after_s)))


def _kill_child(name: str, recorder: Recorder) -> None:
    end = time.monotonic() + CHILD_APPEARS_S
    while (number := recorder.child(name)) is None and time.monotonic() < end:
        time.sleep(0.01)
    if number is not None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(number, signal.SIGKILL)


def _tear(recorder: Recorder, rng: np.random.Generator) -> None:
    """Leaves the beginning of a further row on the disk, as a power cut may."""
    if recorder.data.exists():
        content = recorder.data.read_bytes()
        row = content.splitlines()[-1] if content else b"q1_rad,q2"
        with recorder.data.open("ab") as file:
            file.write(row[: int(rng.integers(1, len(row)))])
