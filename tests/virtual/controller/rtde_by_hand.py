"""RTDE spoken by hand, from the published guide: a second opinion on the server, and a way to misbehave."""

import socket
import struct

FORMATS = {
    "DOUBLE": "d", "VECTOR3D": "3d", "VECTOR6D": "6d", "INT32": "i", "UINT32": "I", "UINT64": "Q", "UINT8": "B",
    "VECTOR6INT32": "6i",
}  # fmt: skip


def package(kind, payload=b""):
    return struct.pack(">HB", 3 + len(payload), ord(kind)) + payload


class Rtde:
    """A connection that has agreed on version 2."""

    def __init__(self, address, patience_s=5.0):
        self.socket = socket.create_connection((address, 30004), patience_s)
        self.names, self.types = [], []
        assert self.ask("V", struct.pack(">H", 2)) == b"\x01"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def ask(self, kind, payload=b""):
        self.socket.sendall(package(kind, payload))
        while True:
            answered, content = self.receive()
            if answered == kind:
                return content

    def receive(self):
        size, kind = struct.unpack(">HB", self._exactly(3))
        return chr(kind), self._exactly(size - 3)

    def outputs(self, names, rate_hz=125.0):
        """Number of the recipe, and the types."""
        answer = self.ask("O", struct.pack(">d", rate_hz) + ",".join(names).encode())
        self.names, self.types = list(names), answer[1:].decode().split(",")
        return answer[0], self.types

    def inputs(self, names):
        """Number of the recipe, and the types."""
        answer = self.ask("I", ",".join(names).encode())
        return answer[0], answer[1:].decode().split(",")

    def start(self, names, rate_hz=125.0):
        assert self.outputs(names, rate_hz)[0] == 1
        assert self.ask("S") == b"\x01"

    def sample(self):
        """The next one, by name."""
        kind, content = self.receive()
        assert kind == "U"
        assert content[0] == 1
        found, at = {}, 1
        for name, kind in zip(self.names, self.types, strict=True):
            form = struct.Struct(">" + FORMATS[kind])
            values = form.unpack_from(content, at)
            found[name] = values if len(values) > 1 else values[0]
            at += form.size
        assert at == len(content)
        return found

    def _exactly(self, count):
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            if not part:
                raise ConnectionError("closed")
            data += part
        return data
