"""The command ``truepath controller``."""

import re
import signal
import socket
import subprocess
import sys

import pytest
from command import is_refused
from ur_client import free_address


def started(*arguments):
    """The command in a process of its own, and the lines it printed until it was ready."""
    process = subprocess.Popen(
        [sys.executable, "-c", MAIN, "controller", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    lines = []
    while not lines or not lines[-1].startswith("tracker"):
        lines.append(process.stdout.readline())
        assert lines[-1], process.stderr.read()
    return process, lines


MAIN = "from truepath.cli import main; main()"


@pytest.mark.parametrize("ended_by", [signal.SIGINT, signal.SIGTERM])
def test_it_prints_where_it_listens_and_ends_cleanly(ended_by):
    address = free_address()
    process, lines = started("--address", address, "--hide", "backlash,joint_compliance", "--fault", "beam_break:0:1")
    assert [tuple(re.split(r"[\s:]+", line.strip())) for line in lines] == [
        ("RTDE", address, "30004"),
        ("dashboard", address, "29999"),
        ("scripts", address, "30003"),
        ("tracker", address, "30100"),
    ]
    with socket.create_connection((address, 29999), 5) as connection:
        assert b"Dashboard" in connection.recv(100)
        process.send_signal(ended_by)
        out, err = process.communicate(timeout=10)
    assert process.returncode == 0
    assert "the controller is off" in out
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--address", "0.0.0.0"], "loopback"),
        (["--fault", "flood:1"], "protective_stop"),
        (["--fault", "restart"], "AFTER_S"),
        (["--tcp", "1,2"], "6 numbers"),
        (["--tracker-at", "here"], "3 numbers"),
        (["--hide", "rust"], "backlash"),
        (["--robot", "ur99"], "ur99"),
    ],
)
def test_what_it_cannot_be_is_refused(truepath, arguments, word):
    assert is_refused(truepath("controller", *arguments), word)
