"""Port 30003: programs as text. Nothing is answered."""

from __future__ import annotations

import re
from collections.abc import Callable

from truepath.virtual.controller.addresses import SCRIPT_PORT
from truepath.virtual.controller.guarded_server import PATIENCE_S, Connection, GuardedServer
from truepath.virtual.controller.wire import ProtocolError

MOST_LINE, MOST_PROGRAM = 1 << 16, 1 << 23
OPENS, CLOSES = re.compile(r"\s*(def|sec|thread|if|while|for)\b"), re.compile(r"\s*end\s*(#.*)?")


class ScriptPort(GuardedServer):
    """Takes programs; a line outside of a program is one by itself.

    Args:
        address: loopback.
        run: called with the text of each program.
    """

    def __init__(self, address: str, run: Callable[[str], None]) -> None:
        super().__init__("script", address, SCRIPT_PORT, MOST_LINE)
        self._run = run

    async def serve(self, connection: Connection) -> None:
        lines: list[str] = []
        size = depth = 0
        while True:
            line = await connection.line(PATIENCE_S if lines else None)
            if not line and not lines:
                return
            ended = not line.endswith("\n")  # a program may come without a last line break
            size += len(line)
            if size > MOST_PROGRAM:
                raise ProtocolError(f"a program of more than {MOST_PROGRAM} bytes")
            if lines or OPENS.match(line):
                lines.append(line)
                depth += bool(OPENS.match(line)) - bool(CLOSES.fullmatch(line.rstrip("\r\n")))
                if depth <= 0:
                    self._run("".join(lines))
                    lines, size, depth = [], 0, 0
                elif ended:
                    raise ProtocolError("it left in the middle of a program")
            elif line.strip() and not line.strip().startswith("#"):
                self._run(line)
                size = 0
            if ended:
                return
