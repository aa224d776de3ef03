"""Guards that go on after whoever they guard has gone: what they still do must not reach the next test."""

import time
from pathlib import Path


def guards_have_gone(address, within_s=10.0):
    """Whether no guard of the robot at an address is left, or is left no longer within a time."""
    end = time.monotonic() + within_s
    while any(_is_guard(process, address) for process in Path("/proc").glob("[0-9]*/cmdline")):
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def _is_guard(process, address):
    try:
        words = process.read_bytes().split(b"\0")
    except OSError:
        return False
    return b"truepath.robot_link.guard_child" in words and address.encode() in words
