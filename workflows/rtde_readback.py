"""Does the unmodified ur_rtde client read a virtual controller for minutes without losing a sample?

A controller runs as a process of its own, its robot driven to and fro; a second process reads it with ur_rtde. A sample
is lost where two time stamps are further apart than a period. Memory of both processes is watched. Prints a verdict;
exits with 1 if something asked for is missed.

    .venv/bin/python workflows/rtde_readback.py [--minutes 10] [--rate-hz 125] [--address 127.0.4.1] [--first]
        [--json FILE]

On a machine that is busy with other things ur_rtde itself drops samples, because it gets the processor too late:
``--first`` gives both processes real-time priority, where the system allows that.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

FLAT_SHARE, FLAT_MB = 0.02, 4.0  # growth of memory that is none
BEFORE_OTHERS = 99  # the highest real-time priority, which ur_rtde takes for its own threads where it may
SETTLED = 0.25  # of the time: from then on memory counts
SWING = """def swing():
  while True:
    movej([0, -1.57, 1.57, -1.57, -1.57, 0], a=1.4, v=1.05, r=0.02)
    movej([0.6, -1.3, 1.3, -1.6, -1.4, 0.3], a=1.4, v=1.05)
    movel(p[-0.45, -0.2, 0.3, 2.2, 2.2, 0], a=1.2, v=0.25)
  end
end
"""


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--rate-hz", type=float, default=125.0)
    parser.add_argument("--address", default="127.0.4.1", help="loopback")
    parser.add_argument("--first", action="store_true", help="with real-time priority, before all other processes")
    parser.add_argument("--json", type=Path, default=None, help="file to write")
    parser.add_argument("--read", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.read:
        print(json.dumps(read(options.address, 60.0 * options.minutes, options.rate_hz)))
        return 0
    if options.first:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(BEFORE_OTHERS))  # children inherit it
    figures = measured(options.address, options.minutes, options.rate_hz)
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    print(
        f"{figures['samples']} samples in {figures['seconds']:.1f} s at {options.rate_hz:g} Hz: "
        f"{figures['lost']} lost, {figures['moved_rad']:.2f} rad seen moving"
    )
    for name in ("reader", "controller"):
        first, last = figures[f"{name}_mb"]
        print(f"memory of the {name}: {first:.1f} MB, {last:.1f} MB at the end")
    print(f"processor time of the controller: {100 * figures['controller_load']:.1f} % of one core")
    print("all as asked for" if figures["passed"] else "something asked for is missed")
    return 0 if figures["passed"] else 1


def measured(address: str, minutes: float, rate_hz: float) -> dict[str, Any]:
    """The figures of one run."""
    from truepath.virtual.controller.process import ControllerProcess

    own = [sys.executable, __file__, "--read", "--address", address]
    with ControllerProcess(address) as controller:
        with socket.create_connection((address, 30003)) as port:
            port.sendall(SWING.encode())
        load = _processor_s(controller.pid)
        reader = subprocess.Popen(
            [*own, "--minutes", str(minutes), "--rate-hz", str(rate_hz)], stdout=subprocess.PIPE, text=True
        )
        begun, memory = time.monotonic(), []
        while reader.poll() is None:
            memory.append(_memory_mb(controller.pid))
            time.sleep(min(1.0, 6.0 * minutes))
        told, _ = reader.communicate()
        load = (_processor_s(controller.pid) - load) / (time.monotonic() - begun)
        log = [line for line in controller.log() if not line.startswith("INFO")]
    figures: dict[str, Any] = {"schema": "truepath.rtde_readback/1", "rate_hz": rate_hz, **json.loads(told)}
    figures |= {"controller_mb": _settled(memory), "controller_load": load, "controller_log": log[-20:]}
    flat = all(_is_flat(*figures[f"{name}_mb"]) for name in ("reader", "controller"))
    enough = figures["samples"] >= 0.99 * 60.0 * minutes * rate_hz
    figures["passed"] = figures["lost"] == 0 and flat and enough and figures["moved_rad"] > 0.1
    return figures


def read(address: str, seconds: float, rate_hz: float) -> dict[str, Any]:
    """In the reading process: what ur_rtde gives within a time."""
    robot = importlib.import_module("rtde_receive").RTDEReceiveInterface(address, rate_hz)
    begun = time.monotonic()
    first = stamp = robot.getTimestamp()
    lowest = highest = robot.getActualQ()[0]
    samples, longest, lost, memory, next_look = 1, 0.0, 0, [], begun
    while (now := time.monotonic()) - begun < seconds:
        newest = robot.getTimestamp()
        if newest == stamp:
            time.sleep(0.1 / rate_hz)
            continue
        samples, longest = samples + 1, max(longest, newest - stamp)
        lost += round((newest - stamp) * rate_hz) - 1
        stamp = newest
        joint = robot.getActualQ()[0]
        lowest, highest = min(lowest, joint), max(highest, joint)
        if now >= next_look:
            memory.append(_memory_mb(os.getpid()))
            next_look += 1.0
    robot.disconnect()
    return {
        "samples": samples,
        "seconds": stamp - first,
        "lost": lost,
        "longest_gap_s": longest,
        "moved_rad": highest - lowest,
        "reader_mb": _settled(memory),
    }


def _settled(memory_mb: Sequence[float]) -> tuple[float, float]:
    """Once everything is loaded, and at the end."""
    return memory_mb[int(SETTLED * len(memory_mb))], memory_mb[-1]


def _is_flat(first_mb: float, last_mb: float) -> bool:
    return last_mb - first_mb <= max(FLAT_MB, FLAT_SHARE * first_mb)


def _memory_mb(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _processor_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    sys.exit(main())
