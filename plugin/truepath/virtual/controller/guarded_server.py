"""A server that survives whoever connects: few connections, bounded bytes, bounded patience, errors logged."""

from __future__ import annotations

import asyncio
import logging
import re
import socket
from abc import ABC, abstractmethod

from truepath.errors import InputError
from truepath.virtual.controller.wire import ProtocolError

MOST_CONNECTIONS = 24
PATIENCE_S = 10.0  # for the rest of a message that has begun
IN_A_ROW = 16  # messages of one client
WRITE_LIMIT = 256 * 1024  # bytes waiting for a client that does not read
SEND_BUFFER = 64 * 1024  # the same in the kernel
FORBIDDEN = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
log = logging.getLogger(__name__)


class Connection:
    """One client."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self._writer, self._messages = reader, writer, 0
        peer = writer.get_extra_info("peername")
        self.peer = f"{peer[0]}:{peer[1]}" if peer else "a client that is gone"
        sock = writer.get_extra_info("socket")
        if sock is not None:
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)

    def send(self, data: bytes) -> None:
        """Answers; a client that lets its answers pile up is given up.

        Raises:
            ProtocolError: it does.
        """
        if not self.has_room:
            raise ProtocolError("it does not read what it is sent")
        self._writer.write(data)

    @property
    def has_room(self) -> bool:
        """Whether the client has read most of what it was sent."""
        return self._writer.transport.get_write_buffer_size() <= WRITE_LIMIT

    def abort(self) -> None:
        """Cut, without a word."""
        self._writer.transport.abort()

    async def first_byte(self, patience_s: float | None) -> bytes:
        """Of the next message; empty where the client has left.

        Raises:
            ProtocolError: it does not come in time.
        """
        try:
            return await asyncio.wait_for(self.reader.read(1), patience_s)
        except asyncio.TimeoutError as error:
            raise ProtocolError(f"it has said nothing for {patience_s:g} s") from error

    async def exactly(self, count: int) -> bytes:
        """The rest of a message.

        Raises:
            ProtocolError: it does not come.
        """
        await self._let_others_go()
        try:
            return await asyncio.wait_for(self.reader.readexactly(count), PATIENCE_S)
        except asyncio.IncompleteReadError as error:
            raise ProtocolError("it went away in the middle of a message") from error
        except asyncio.TimeoutError as error:
            raise ProtocolError(f"the rest of its message did not come within {PATIENCE_S:g} s") from error

    async def line(self, patience_s: float | None = None) -> str:
        """The next line with its line break; without one, or empty, where the client has left.

        Raises:
            ProtocolError: it does not come in time, has no end, or is no text.
        """
        await self._let_others_go()
        try:
            raw = await asyncio.wait_for(self.reader.readuntil(b"\n"), patience_s)
        except asyncio.TimeoutError as error:
            raise ProtocolError(f"the rest of its message did not come within {patience_s:g} s") from error
        except asyncio.IncompleteReadError as error:
            raw = error.partial
        except asyncio.LimitOverrunError as error:
            raise ProtocolError("a line without end") from error
        try:
            text = raw.decode("utf-8")
        except UnicodeDecodeError as error:
            raise ProtocolError("this is no text") from error
        if FORBIDDEN.search(text):
            raise ProtocolError("control characters in a line")
        return text

    async def _let_others_go(self) -> None:
        """Now and then: a buffer full of messages must not keep everybody waiting."""
        self._messages += 1
        if self._messages % IN_A_ROW == 0:
            await asyncio.sleep(0)


class GuardedServer(ABC):
    """Listens on one port; each connection is served by ``serve``.

    Args:
        name: for the log.
        address, port: where.
        read_limit: most bytes that may wait to be read of one connection.
    """

    def __init__(self, name: str, address: str, port: int, read_limit: int = 1 << 16) -> None:
        self._name, self._address, self._port, self._read_limit = name, address, port, read_limit
        self._server: asyncio.Server | None = None
        self._tasks: dict[asyncio.Task[None], Connection] = {}

    @abstractmethod
    async def serve(self, connection: Connection) -> None:
        """Until the client leaves or makes a mistake.

        Raises:
            ProtocolError: the mistake.
        """

    async def listen(self) -> None:
        """Opens the port.

        Raises:
            InputError: somebody else has it.
        """
        try:
            self._server = await asyncio.start_server(
                self._accept, self._address, self._port, limit=self._read_limit, backlog=MOST_CONNECTIONS
            )
        except OSError as error:
            raise InputError(
                f"port {self._port} of {self._address} cannot be opened",
                expected="an address on which no other controller listens: 127.0.0.1, 127.0.0.2, ...",
                found=error.strerror or str(error),
            ) from error

    @property
    def connections(self) -> int:
        """How many clients there are."""
        return len(self._tasks)

    def close(self) -> None:
        """Closes the port and cuts all connections."""
        if self._server is not None:
            self._server.close()
            self._server = None
        for task, connection in list(self._tasks.items()):
            connection.abort()
            task.cancel()

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connection = Connection(reader, writer)
        task = asyncio.current_task()
        if task is None or len(self._tasks) >= MOST_CONNECTIONS:
            log.error("%s: %s refused, %d others are connected", self._name, connection.peer, len(self._tasks))
            connection.abort()
            return
        self._tasks[task] = connection
        try:
            await self.serve(connection)
            writer.close()
        except ProtocolError as error:
            log.error("%s: connection of %s closed: %s", self._name, connection.peer, error)
            connection.abort()
        except (ConnectionError, asyncio.CancelledError):
            connection.abort()
        except Exception:  # one connection must never take the others along
            log.exception("%s: connection of %s closed by a fault of the controller", self._name, connection.peer)
            connection.abort()
        finally:
            del self._tasks[task]
