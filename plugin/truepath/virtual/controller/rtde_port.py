"""Port 30004: Real-Time Data Exchange, version 2."""

from __future__ import annotations

import asyncio
import logging
import math
import struct
import time
from collections.abc import Callable
from typing import ClassVar

from truepath.virtual.controller.addresses import RTDE_PORT
from truepath.virtual.controller.guarded_server import PATIENCE_S, Connection, GuardedServer
from truepath.virtual.controller.machine import Machine
from truepath.virtual.controller.outputs import OUTPUTS, Getter, Sample
from truepath.virtual.controller.packet_weather import PacketWeather, StreamWeather
from truepath.virtual.controller.registers import INPUT_TYPES
from truepath.virtual.controller.wire import (
    HEADER,
    IN_USE,
    NOT_FOUND,
    Kind,
    ProtocolError,
    Recipe,
    names_in,
    package,
)

CONTROL_VERSION = (5, 13, 0, 1111)
MOST_FREQUENCY_HZ = 500.0
MOST_PACKAGE = 8192
MOST_VARIABLES, MOST_RECIPES = 256, 64
LATE_S = 2.0  # what is later than that is left out: the machine was suspended
APART_S, APART_SHARE = 0.001, 0.5  # of packages that are late: a client that finds two at once drops the first
UNREAD_S = 10.0  # so long may a client not read before it is given up
log = logging.getLogger(__name__)


class RtdePort(GuardedServer):
    """Serves any number of clients, each at its own rate.

    Args:
        address: loopback.
        machine: whose values are told and whose registers are written.
        weather: what befalls packages on their way.
        written: called after a client has written registers.
    """

    def __init__(self, address: str, machine: Machine, weather: PacketWeather, written: Callable[[], None]) -> None:
        super().__init__("RTDE", address, RTDE_PORT)
        self.machine, self.weather, self.written = machine, weather, written

    async def serve(self, connection: Connection) -> None:
        client = _Client(self, connection)
        try:
            while await client.handle_next():
                pass
        finally:
            client.leave()


class _Client:
    """One connection: its recipes and its stream."""

    def __init__(self, port: RtdePort, connection: Connection) -> None:
        self._port, self._connection, self._registers = port, connection, port.machine.registers
        self._agreed = False
        self._output: tuple[Recipe, list[Getter]] | None = None
        self._frequency_hz = MOST_FREQUENCY_HZ
        self._inputs: dict[int, Recipe] = {}
        self._stream: asyncio.Task[None] | None = None

    async def handle_next(self) -> bool:
        """One package; False when the client has left.

        Raises:
            ProtocolError: it is none.
        """
        first = await self._connection.first_byte(None if self._agreed else PATIENCE_S)
        if not first:
            return False
        size, kind = HEADER.unpack(first + await self._connection.exactly(HEADER.size - 1))
        if not HEADER.size <= size <= MOST_PACKAGE:
            raise ProtocolError(f"a package of {size} bytes")
        payload = await self._connection.exactly(size - HEADER.size)
        try:
            handle = self._handlers[Kind(kind)]
        except (ValueError, KeyError):
            raise ProtocolError(f"a package of kind {kind}") from None
        if not self._agreed and handle is not _Client._version and handle is not _Client._control_version:
            raise ProtocolError("it has not asked for version 2 of the protocol")
        answer = handle(self, payload)
        if answer is not None:
            self._connection.send(package(Kind(kind), answer))
        if Kind(kind) is Kind.START and answer == b"\x01":  # after the answer: a client expects it before any data
            self._stream = asyncio.create_task(self._send_data())
        return True

    def leave(self) -> None:
        """Frees what the client used."""
        self._stop_stream()
        self._registers.release(self)

    def _version(self, payload: bytes) -> bytes:
        if len(payload) != 2:
            raise ProtocolError("a version of the protocol has two bytes")
        self._agreed = struct.unpack(">H", payload)[0] == 2
        return struct.pack(">?", self._agreed)

    def _control_version(self, payload: bytes) -> bytes:
        return struct.pack(">4I", *CONTROL_VERSION)

    def _setup_outputs(self, payload: bytes) -> bytes:
        if len(payload) < 8:
            raise ProtocolError("a set-up of outputs begins with a frequency")
        (frequency,) = struct.unpack(">d", payload[:8])
        if not (math.isfinite(frequency) and frequency > 0):
            raise ProtocolError(f"a frequency of {frequency} Hz")
        names = names_in(payload[8:], MOST_VARIABLES)
        types = [OUTPUTS[name][0] if name in OUTPUTS else NOT_FOUND for name in names]
        self._stop_stream()
        self._output = None
        if NOT_FOUND not in types:
            self._output = Recipe(1, names, types), [OUTPUTS[name][1] for name in names]
            self._frequency_hz = min(frequency, MOST_FREQUENCY_HZ)
        return bytes([self._output is not None]) + ",".join(types).encode()

    def _setup_inputs(self, payload: bytes) -> bytes:
        names = names_in(payload, MOST_VARIABLES)
        number = len(self._inputs) + 1
        if number > MOST_RECIPES:
            raise ProtocolError(f"more than {MOST_RECIPES} recipes")
        types = [INPUT_TYPES.get(name, NOT_FOUND) for name in names]
        if NOT_FOUND not in types:
            free = [self._registers.claim(name, self) for name in names]
            types = [kind if mine else IN_USE for kind, mine in zip(types, free, strict=True)]
        good = NOT_FOUND not in types and IN_USE not in types
        if good:
            self._inputs[number] = Recipe(number, names, types)
        return bytes([number if good else 0]) + ",".join(types).encode()

    def _start(self, payload: bytes) -> bytes:
        self._stop_stream()
        return struct.pack(">?", self._output is not None)

    def _pause(self, payload: bytes) -> bytes:
        self._stop_stream()
        return b"\x01"

    def _data(self, payload: bytes) -> None:
        if not payload or payload[0] not in self._inputs:
            raise ProtocolError("data for a recipe that was not agreed")
        slider = self._registers.speed_slider
        self._registers.write(self._inputs[payload[0]].values(payload))
        if self._registers.speed_slider != slider:
            self._port.machine.speed_slider_moved()
        self._port.written()

    def _message(self, payload: bytes) -> None:
        log.info("RTDE: %s says %r", self._connection.peer, payload[:200])

    _handlers: ClassVar[dict[Kind, Callable[[_Client, bytes], bytes | None]]] = {
        Kind.PROTOCOL_VERSION: _version,
        Kind.CONTROL_VERSION: _control_version,
        Kind.SETUP_OUTPUTS: _setup_outputs,
        Kind.SETUP_INPUTS: _setup_inputs,
        Kind.START: _start,
        Kind.PAUSE: _pause,
        Kind.DATA: _data,
        Kind.TEXT_MESSAGE: _message,
    }

    def _stop_stream(self) -> None:
        if self._stream is not None:
            self._stream.cancel()
            self._stream = None

    async def _send_data(self) -> None:
        """A package each period of a clock that never drifts: the k-th is due k periods after the first."""
        try:
            await self._stream_packages()
        except (ProtocolError, OSError) as error:
            log.error("RTDE: connection of %s closed: %s", self._connection.peer, error)
            self._connection.abort()
        except Exception:  # a fault of the controller itself: the client must not wait for ever
            log.exception("RTDE: connection of %s closed by a fault of the controller", self._connection.peer)
            self._connection.abort()

    async def _stream_packages(self) -> None:
        machine, weather, connection = self._port.machine, StreamWeather(self._port.weather), self._connection
        if self._output is None:
            return
        recipe, getters = self._output
        period, first = 1.0 / self._frequency_hz, time.monotonic()
        number, read_at = 0, first
        sample: Sample | None = None
        while True:
            now = time.monotonic()
            due = first + number * period
            if now < due:
                await asyncio.sleep(due - now)
                continue
            if now - due > LATE_S:
                skipped = int((now - due) / period)
                log.warning("RTDE: %d packages left out, the machine was busy", skipped)
                number += skipped
                due = first + number * period
            number += 1
            if connection.has_room:
                read_at = now
            elif now - read_at > UNREAD_S:
                raise ProtocolError("it does not read what it is sent")
            else:
                continue
            if weather.loses_package():
                continue
            sample = Sample(machine, machine.clock.at_wall(due), sample)
            data = recipe.package([get(sample) for get in getters])
            await weather.delay()
            connection.send(data)
            if time.monotonic() - first - number * period > 0:
                await asyncio.sleep(max(APART_S, APART_SHARE * period))
