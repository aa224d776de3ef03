"""Whoever sends rubbish is shown the door; everybody else does not notice. Memory stays where it was."""

import asyncio
import contextlib
import os
import random
import socket
import struct
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from drawn_robot import SPEED_UP, until
from rtde_by_hand import Rtde, package
from truepath.virtual.controller import guarded_server, rtde_port, script_port
from truepath.virtual.controller.guarded_server import Connection, GuardedServer
from truepath.virtual.controller.packet_weather import PacketWeather
from truepath.virtual.controller.registers import Registers
from truepath.virtual.controller.rtde_port import RtdePort
from truepath.virtual.controller.script_port import ScriptPort

RTDE, DASHBOARD, SCRIPT = 30004, 29999, 30003
VERSION = package("V", struct.pack(">H", 2))
RUBBISH = {
    "size of nothing": (RTDE, struct.pack(">HB", 0, 86)),
    "size below the header": (RTDE, struct.pack(">HB", 2, 86)),
    "too large a package": (RTDE, struct.pack(">HB", 65535, 86)),
    "unknown kind": (RTDE, struct.pack(">HB", 3, 1)),
    "text": (RTDE, b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n"),
    "no version": (RTDE, package("S")),
    "version of one byte": (RTDE, package("V", b"\x02")),
    "version 1": (RTDE, package("V", struct.pack(">H", 1)) + package("O", b"timestamp")),
    "frequency missing": (RTDE, VERSION + package("O", b"time")),
    "frequency nan": (RTDE, VERSION + package("O", struct.pack(">d", float("nan")) + b"timestamp")),
    "frequency negative": (RTDE, VERSION + package("O", struct.pack(">d", -1.0) + b"timestamp")),
    "names not ASCII": (RTDE, VERSION + package("I", b"\xff\xfe,")),
    "no names": (RTDE, VERSION + package("I", b"")),
    "too many names": (RTDE, VERSION + package("I", b"a," * 2000)),
    "data without recipe": (RTDE, VERSION + package("U", b"\x07" + bytes(8))),
    "data of nothing": (RTDE, VERSION + package("U")),
    "data too short": (RTDE, VERSION + package("I", b"input_int_register_40") + package("U", b"\x01\x00")),
    "too many recipes": (RTDE, VERSION + package("I", b"input_int_register_40") * 300),
    "endless line": (DASHBOARD, b"a" * 100_000),
    "no text": (DASHBOARD, b"\xff\xfe\n"),
    "control characters": (DASHBOARD, b"stop\x00\n"),
    "program without text": (SCRIPT, b"def p():\n\x80\x81\nend\n"),
    "program of control characters": (SCRIPT, b"def p():\n  movej(\x00)\nend\n"),
    "endless line of a program": (SCRIPT, b"def p():\n" + b"x" * 200_000),
}


@pytest.fixture(autouse=True)
def others_go_on(quick):
    """An honest reader, connected before; afterwards it has missed nothing, and the robot has not moved."""
    before = quick.command({"do": "state"})
    with Rtde(quick.address) as reader:
        reader.start(["timestamp", "actual_q"], 50)
        yield
        wanted = quick.command({"do": "state"})["time_s"]
        samples = [reader.sample()]
        while samples[-1]["timestamp"] < wanted:
            samples.append(reader.sample())
    steps = np.diff([sample["timestamp"] for sample in samples])
    assert np.allclose(steps, SPEED_UP / 50, atol=1e-9)
    after = quick.command({"do": "state"})
    assert after["commanded_q_rad"] == before["commanded_q_rad"]
    assert after["moves"] == before["moves"]


def is_closed(connection, patience_s=5.0):
    """Whether the other side hangs up, whatever it says before."""
    connection.settimeout(patience_s)
    try:
        while connection.recv(65536):
            pass
    except TimeoutError:
        return False
    except ConnectionError:
        return True
    return True


@pytest.mark.parametrize("name", RUBBISH)
def test_rubbish_closes_its_connection_with_an_error_in_the_log(quick, name):
    port, data = RUBBISH[name]
    said = len([line for line in quick.log() if line.startswith("ERROR")])
    with socket.create_connection((quick.address, port), 5) as connection:
        connection.sendall(data)
        assert is_closed(connection)
    until(lambda: len([line for line in quick.log() if line.startswith("ERROR")]) > said)
    assert not any("Traceback" in line for line in quick.log())


@pytest.mark.parametrize("port", [RTDE, DASHBOARD, SCRIPT])
def test_whatever_bytes_come_the_controller_goes_on(quick, port):
    dice = random.Random(port)
    good = {
        RTDE: VERSION + package("O", struct.pack(">d", 125.0) + b"timestamp,actual_q") + package("S") + package("P"),
        DASHBOARD: b"PolyscopeVersion\nrobotmode\nsafetystatus\n",
        SCRIPT: b"def p():\n  x = [1, 2]\n  textmsg(x)\nend\n",
    }[port]
    for _ in range(60):
        data = bytearray(good)
        for _ in range(dice.randrange(1, 4)):
            at = dice.randrange(len(data))
            data[at : at + dice.randrange(3)] = dice.randbytes(dice.randrange(5))
        with socket.create_connection((quick.address, port), 5) as connection:
            connection.sendall(bytes(data) if dice.random() < 0.7 else dice.randbytes(dice.randrange(1, 3000)))
    assert quick.command({"do": "state"})["safety"] == "normal"
    assert not any("Traceback" in line for line in quick.log())
    until(lambda: quick.command({"do": "state"})["connections"] == 1)


def test_a_client_that_does_not_read_blocks_nobody_and_fills_no_memory(quick):
    with Rtde(quick.address) as lazy:
        lazy.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        lazy.start([f"output_double_register_{k}" for k in range(48)] * 5, 500)
        time.sleep(0.3)
        before = memory_mb(quick.pid)
        time.sleep(0.7)
        assert memory_mb(quick.pid) - before < 2.0


def test_a_dashboard_that_is_asked_without_end_and_never_read_is_given_up(quick):
    with socket.create_connection((quick.address, DASHBOARD), 5) as connection:
        connection.settimeout(5)
        with contextlib.suppress(OSError):
            for _ in range(3000):
                connection.sendall(b"x" * 200 + b"\n" + b"PolyscopeVersion\n" * 200)
    until(lambda: any("does not read" in line for line in quick.log()))


def test_no_more_than_a_few_connections_are_taken(quick):
    connections = [socket.create_connection((quick.address, SCRIPT), 5) for _ in range(40)]
    try:
        until(lambda: any("refused" in line for line in quick.log()))
        assert quick.command({"do": "state"})["connections"] <= 1 + guarded_server.MOST_CONNECTIONS
    finally:
        for connection in connections:
            connection.close()


def test_a_program_that_does_not_come_to_its_end_is_given_up(monkeypatch):
    monkeypatch.setattr(script_port, "PATIENCE_S", 0.05)
    assert served(ScriptPort("127.0.0.1", lambda text: None), b"def p():\n  movej(") == "closed"


def test_a_client_that_says_nothing_is_given_up(monkeypatch):
    monkeypatch.setattr(rtde_port, "PATIENCE_S", 0.05)
    machine = SimpleNamespace(registers=Registers())
    assert served(RtdePort("127.0.0.1", machine, PacketWeather(0), lambda: None), b"") == "closed"


def test_a_package_that_does_not_come_to_its_end_is_given_up(monkeypatch):
    monkeypatch.setattr(guarded_server, "PATIENCE_S", 0.05)

    class Fixed(GuardedServer):
        async def serve(self, connection: Connection) -> None:
            await connection.exactly(10)

    assert served(Fixed("fixed", "127.0.0.1", 0), b"1234") == "closed"


def served(server, data):
    """What becomes of a client of a server in this process that sends some bytes and then nothing."""

    async def session():
        listening = await asyncio.start_server(server._accept, "127.0.0.1", 0)
        reader, writer = await asyncio.open_connection(*listening.sockets[0].getsockname())
        writer.write(data)
        try:
            await asyncio.wait_for(reader.read(), 3.0)
            outcome = "closed"
        except ConnectionError:
            outcome = "closed"
        except asyncio.TimeoutError:
            outcome = "open"
        writer.close()
        listening.close()
        return outcome

    return asyncio.run(session())


def memory_mb(pid):
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
