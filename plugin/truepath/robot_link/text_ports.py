"""The controller's text ports: the dashboard, which answers questions, and the one that takes programs."""

from __future__ import annotations

import contextlib
import socket
import time

from truepath.robot_link.fault import RobotFault

DASHBOARD_PORT, SCRIPT_PORT = 29999, 30003
LONGEST_ANSWER = 4096
LINGER_S = 0.3
STARTS_WITHIN_S = 10.0  # from the arrival of a program until it runs
STOP_PROGRAM = "def truepath_stop():\n  stopj(2)\nend\n"


def ask_dashboard(host: str, question: str, timeout_s: float) -> str:
    """What the dashboard says to a question such as ``safetystatus``.

    Raises:
        RobotFault: it cannot be reached, does not answer in time, or answers something endless.
    """
    try:
        with socket.create_connection((host, DASHBOARD_PORT), timeout_s) as connection:
            end = time.monotonic() + timeout_s
            _line(connection, end)  # a greeting comes first
            connection.sendall(question.encode("ascii", "replace") + b"\n")
            return _line(connection, end)
    except OSError as error:
        raise RobotFault(f"the dashboard of {host} does not answer {question!r}: {_words(error)}") from None


def send_program(host: str, text: str, timeout_s: float) -> None:
    """Sends a URScript program, which the controller starts at once, in place of what it was running.

    Raises:
        RobotFault: the port cannot be reached or does not take the text.
    """
    data = text.encode("utf-8")
    try:
        with socket.create_connection((host, SCRIPT_PORT), timeout_s) as connection:
            connection.sendall(data if data.endswith(b"\n") else data + b"\n")
            connection.shutdown(socket.SHUT_WR)
            # The port also sends without being asked. Closing on unread bytes would reset the connection, and the
            # controller might never read the end of the program.
            connection.settimeout(LINGER_S)
            end = time.monotonic() + LINGER_S
            with contextlib.suppress(OSError):
                while time.monotonic() < end and connection.recv(65536):
                    pass
    except OSError as error:
        raise RobotFault(f"the program could not be sent to {host}: {_words(error)}") from None


def _line(connection: socket.socket, end: float) -> str:
    received = b""
    while b"\n" not in received:
        left = end - time.monotonic()
        if left <= 0:
            raise TimeoutError("timed out")
        connection.settimeout(left)
        part = connection.recv(LONGEST_ANSWER)
        if not part:
            raise ConnectionError("the connection was closed")
        received += part
        if len(received) > LONGEST_ANSWER:
            raise ConnectionError("an answer without end")
    return received.split(b"\n")[0].decode("utf-8", "replace").strip()


def _words(error: OSError) -> str:
    return error.strerror or str(error) or type(error).__name__
