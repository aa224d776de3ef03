"""A virtual controller in a process of its own, from the side of whoever needs one."""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Sequence
from types import TracebackType
from typing import IO, Any

from truepath.errors import InputError
from truepath.virtual.controller.addresses import TRACKER_PORT, checked_loopback
from truepath.virtual.controller.options import ControllerOptions

START_S, ANSWER_S, END_S = 60.0, 20.0, 5.0
LOG_LINES = 2000
ENDED = ""  # no answer is an empty line


class ControllerProcess:
    """A virtual controller: unmodified clients of Universal Robots connect to its address while the context is open.

    It must be a process of its own: constructors of ``ur_rtde`` hold the interpreter while they wait for answers.

    Args:
        address: loopback; the ports are those of a real controller, so two controllers need two addresses.
        robot: a cell with a reflector, or a built-in robot.
        seed: of its hidden errors, as in ``truepath simulate``.
        hide: names of hidden causes.
        noise_mm: of the tracker, per coordinate.
        speed_up: how many times faster than the clock on the wall the robot lives. Its time stamps, speeds and
            temperatures are in its own seconds; packets come at the rate that was asked for, in seconds of the wall.
        payload_kg, payload_cog_m, tcp_offset: of the installation; by default as the cell is drawn.
        remote_control: what the dashboard says.
        q_start_rad: where the arm stands at first; by default at the cell's home.
        tracker_port, tracker_rate_hz: of the tracker's stream.
        tracker_at_m: where the tracker stands in the world, its axes parallel to the world's; by default it measures
            in the world itself.
        acceptance_deg: half angle of the cone about the reflector's z axis from which that tracker can see it.

    Attributes:
        address, tracker_port: where to connect.
        pid: of the process; 0 before it starts.

    Raises:
        InputError: an address that is not loopback; on entering also whatever else cannot be.
    """

    def __init__(
        self,
        address: str = "127.0.0.1",
        *,
        robot: str = "ur5_cell",
        seed: int = 0,
        hide: Sequence[str] = (),
        noise_mm: float = 0.02,
        speed_up: float = 1.0,
        payload_kg: float | None = None,
        payload_cog_m: Sequence[float] | None = None,
        tcp_offset: Sequence[float] | None = None,
        remote_control: bool = True,
        q_start_rad: Sequence[float] | None = None,
        tracker_port: int = TRACKER_PORT,
        tracker_rate_hz: float = 50.0,
        tracker_at_m: Sequence[float] | None = None,
        acceptance_deg: float = 180.0,
    ) -> None:
        self.address, self.tracker_port, self.pid = checked_loopback(address), tracker_port, 0
        self._options = ControllerOptions(
            address=address,
            robot=str(robot),
            seed=seed,
            hide=list(hide),
            noise_mm=noise_mm,
            speed_up=speed_up,
            payload_kg=payload_kg,
            payload_cog_m=_listed(payload_cog_m),
            tcp_offset=_listed(tcp_offset),
            remote_control=remote_control,
            q_start_rad=_listed(q_start_rad),
            tracker_port=tracker_port,
            tracker_rate_hz=tracker_rate_hz,
            tracker_at_m=_listed(tracker_at_m),
            acceptance_deg=acceptance_deg,
        )
        self._log: deque[str] = deque(maxlen=LOG_LINES)
        self._answers: queue.Queue[str] = queue.Queue()
        self._process: subprocess.Popen[str] | None = None
        self._asking = threading.Lock()

    def __enter__(self) -> ControllerProcess:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "truepath.virtual.controller"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.pid = self._process.pid
        self._read(self._process.stdout, self._answers.put)
        self._read(self._process.stderr, self._log.append)
        try:
            self._ask(self._options.to_json(), START_S)
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def command(self, order: dict[str, Any]) -> dict[str, Any]:
        """An order to the controller itself, beside its protocols; the answer.

        ``{"do": "state"}``; ``{"do": "fault", "name": ..., "after_s": ..., "for_s": ...}`` with the names of
        ``faults.FAULTS`` and seconds of the wall; ``{"do": "recover"}`` from whatever stopped it; ``{"do": "stop"}``;
        ``{"do": "set", ...}`` with ``remote_control``, ``payload_kg``, ``payload_cog_m``, ``tcp_offset``, ``q_rad``.

        Raises:
            InputError: an order that does not exist.
            RuntimeError: the process has ended, or does not answer.
        """
        return self._ask(json.dumps(order), ANSWER_S)

    def log(self) -> list[str]:
        """The last lines of its log."""
        return list(self._log)

    def close(self) -> None:
        """Ends the process."""
        process, self._process = self._process, None
        if process is None:
            return
        for stream in (process.stdin,):
            if stream is not None:
                stream.close()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _ask(self, line: str, patience_s: float) -> dict[str, Any]:
        with self._asking:
            process = self._process
            if process is None or process.stdin is None:
                raise RuntimeError("the virtual controller is not running")
            try:
                process.stdin.write(line + "\n")
                process.stdin.flush()
                answer = self._answers.get(timeout=patience_s)
            except (OSError, queue.Empty):
                answer = ENDED
        if answer == ENDED:
            tail = "\n".join(self.log()[-20:])
            raise RuntimeError(f"the virtual controller does not answer; its log ends:\n{tail}")
        content: dict[str, Any] = json.loads(answer)
        if "error" in content:
            raise InputError(content["error"])
        return content

    @staticmethod
    def _read(stream: IO[str] | None, take: Any) -> None:
        def lines() -> None:
            if stream is not None:
                for line in stream:
                    take(line.rstrip("\n"))
                take(ENDED)

        threading.Thread(target=lines, daemon=True).start()


def _listed(numbers: Any) -> list[float] | None:
    return None if numbers is None else [float(number) for number in numbers]
