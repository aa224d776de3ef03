"""Where a virtual controller may listen: on this machine and nowhere else."""

from __future__ import annotations

import ipaddress

from truepath.errors import InputError

RTDE_PORT, DASHBOARD_PORT, SCRIPT_PORT = 30004, 29999, 30003  # the client hard-codes them
TRACKER_PORT = 30100


def checked_loopback(address: str) -> str:
    """The address, if it is one of 127.0.0.0/8.

    Raises:
        InputError: any other address, or a name. A simulated robot that takes commands from a network would be taken
            for a real one, and has no protection against who speaks to it.
    """
    try:
        allowed = ipaddress.IPv4Address(address).is_loopback
    except ValueError:
        allowed = False
    if not allowed:
        raise InputError(
            "a virtual controller listens on this machine only",
            expected="a loopback address: 127.0.0.1, 127.0.0.2, ...",
            found=repr(address),
        )
    return address
