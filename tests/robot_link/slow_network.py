"""A network between a client and a virtual controller on which programs are under way for a while."""

import contextlib
import socket
import threading
import time
from collections.abc import Sequence

PORTS = (29999, 30003, 30004)
SCRIPT_PORT = 30003


class SlowNetwork:
    """A context manager: at ``front`` there is what is at ``back``.

    Args:
        front, back: addresses.
        delays_s: of the programs of the first, second, ... visit to the script port; the last is that of all others.

    Attributes:
        sent: is set when the first program has left its client.
    """

    def __init__(self, front: str, back: str, delays_s: Sequence[float]) -> None:
        self.front, self.back, self.delays_s = front, back, list(delays_s)
        self.sent = threading.Event()
        self._sockets: list[socket.socket] = []

    def __enter__(self):
        for port in PORTS:
            server = socket.create_server((self.front, port))
            self._sockets.append(server)
            threading.Thread(target=self._accept, args=(server, port), daemon=True).start()
        return self

    def __exit__(self, *_):
        for each in self._sockets:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def _accept(self, server, port):
        with contextlib.suppress(OSError):
            while True:
                visitor, _ = server.accept()
                beyond = socket.create_connection((self.back, port))
                self._sockets += [visitor, beyond]
                delay_s = 0.0
                if port == SCRIPT_PORT:
                    delay_s = self.delays_s.pop(0) if len(self.delays_s) > 1 else self.delays_s[0]
                for ends in ((visitor, beyond, delay_s, port == SCRIPT_PORT), (beyond, visitor, 0.0, False)):
                    threading.Thread(target=self._pass_on, args=ends, daemon=True).start()

    def _pass_on(self, source, target, delay_s, is_program):
        with contextlib.suppress(OSError):
            while data := source.recv(1 << 16):
                if is_program:
                    self.sent.set()
                    time.sleep(delay_s)
                target.sendall(data)
            target.shutdown(socket.SHUT_WR)
