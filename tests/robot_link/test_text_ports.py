"""Dashboard and script port against whatever may listen there."""

import contextlib
import socket
import threading
import time

import pytest
from truepath.robot_link import RobotFault
from truepath.robot_link.text_ports import ask_dashboard, send_program

HOST = "127.0.2.97"


@contextlib.contextmanager
def one_visitor(port, serve):
    with socket.create_server((HOST, port)) as server:

        def accept():
            with contextlib.suppress(OSError):
                connection, _ = server.accept()
                with connection:
                    serve(connection)

        thread = threading.Thread(target=accept)
        thread.start()
        yield
        thread.join(5.0)


def talk(*pieces):
    def serve(connection):
        for piece in pieces:
            connection.sendall(piece)
            time.sleep(0.02)
        connection.recv(1000)

    return serve


def test_the_greeting_is_no_answer():
    with one_visitor(29999, talk(b"Connected: Universal Robots Dashboard Server\n", b"Safety", b"status: NORMAL\n")):
        assert ask_dashboard(HOST, "safetystatus", 1.0) == "Safetystatus: NORMAL"


@pytest.mark.parametrize(
    "serve",
    [talk(b"hello\n"), talk(b"\xff" * 100_000), talk(b"hello\n", b"x" * 100_000), lambda connection: None],
    ids=["silent", "endless greeting", "endless answer", "hangs up"],
)
def test_a_dashboard_that_does_not_answer_is_told_in_time(serve):
    begin = time.monotonic()
    with one_visitor(29999, serve), pytest.raises(RobotFault, match="dashboard"):
        ask_dashboard(HOST, "safetystatus", 0.3)
    assert time.monotonic() - begin < 1.5


def test_a_program_arrives_whole_though_the_port_talks_all_the_time():
    received = bytearray()

    def stream(connection):
        connection.settimeout(0.01)
        while True:
            connection.sendall(b"\x00" * 1000)  # the controller's own data
            try:
                part = connection.recv(65536)
            except TimeoutError:
                continue
            if not part:
                return
            received.extend(part)

    program = "def p():\n" + "  sleep(0.1)\n" * 20_000 + "end"
    with one_visitor(30003, stream):
        send_program(HOST, program, 5.0)
    assert received.decode() == program + "\n"


def test_nobody_takes_the_program():
    with pytest.raises(RobotFault, match="could not be sent"):
        send_program("127.0.2.96", "def p():\nend\n", 0.5)
