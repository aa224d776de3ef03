"""All of a virtual controller in one process: ports in front, robot and tracker behind."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

import numpy as np

from truepath import lie
from truepath.errors import InputError
from truepath.virtual.controller.addresses import checked_loopback
from truepath.virtual.controller.clock import Clock
from truepath.virtual.controller.control_script import ControlScript, is_control_script
from truepath.virtual.controller.dashboard_port import DashboardPort
from truepath.virtual.controller.eye import Eye
from truepath.virtual.controller.faults import schedule
from truepath.virtual.controller.guarded_server import GuardedServer
from truepath.virtual.controller.kinematics import NominalKinematics
from truepath.virtual.controller.machine import Machine
from truepath.virtual.controller.options import ControllerOptions
from truepath.virtual.controller.ordinary_program import OrdinaryProgram
from truepath.virtual.controller.packet_weather import PacketWeather
from truepath.virtual.controller.planning import joints_of
from truepath.virtual.controller.rtde_port import RtdePort
from truepath.virtual.controller.script_port import ScriptPort
from truepath.virtual.controller.tracker_stream import TrackerStream

REOPEN_TRIES, REOPEN_WAIT_S = 50, 0.1
log = logging.getLogger(__name__)


class Service:
    """A controller that listens once it is opened.

    Args:
        options: of the controller.

    Raises:
        InputError: options that cannot be.
    """

    def __init__(self, options: ControllerOptions) -> None:
        self.options = options
        address = checked_loopback(options.address)
        kinematics = NominalKinematics(options.robot)
        self.machine = Machine(
            kinematics, Clock(options.speed_up), options.payload_kg, options.payload_cog_m, options.tcp_offset
        )
        self.machine.condition.remote_control = bool(options.remote_control)
        self._q_start = None if options.q_start_rad is None else joints_of(options.q_start_rad, kinematics)
        at = options.tracker_at_m
        X_MW = None if at is None else lie.make_pose(translation=-_point(at))
        self.eye = Eye(
            self.machine, options.robot, options.seed, options.hide, options.noise_mm, X_MW, options.acceptance_deg
        )
        self.weather = PacketWeather(options.seed)
        self._ports: list[GuardedServer] = [
            RtdePort(address, self.machine, self.weather, self._registers_written),
            DashboardPort(address, self.machine),
            ScriptPort(address, self._run),
        ]
        self._tracker: TrackerStream | None = None
        self._reopening: asyncio.Task[None] | None = None

    async def open(self) -> None:
        """Opens all ports.

        Raises:
            InputError: one of them is taken.
        """
        if self._q_start is not None:
            self.machine.arm.place(self._q_start)
        try:
            for port in self._ports:
                await port.listen()
            options = self.options
            self._tracker = TrackerStream(
                options.address, options.tracker_port, self.eye.look, rate_hz=options.tracker_rate_hz
            )
        except InputError:
            self.close()
            raise

    def close(self) -> None:
        """Closes all ports."""
        if self._reopening is not None:
            self._reopening.cancel()
        for port in self._ports:
            port.close()
        if self._tracker is not None:
            self._tracker.close()
            self._tracker = None

    def disconnect(self, for_s: float) -> None:
        """The cable of the controller is pulled for some seconds of the wall; the tracker has its own."""
        log.warning("all connections are cut for %g s", for_s)
        if self._reopening is not None:
            self._reopening.cancel()
        for port in self._ports:
            port.close()
        self._reopening = asyncio.create_task(self._reopen(for_s))

    async def _reopen(self, after_s: float) -> None:
        await asyncio.sleep(after_s)
        for port in self._ports:
            for attempt in range(REOPEN_TRIES):
                try:
                    await port.listen()
                    break
                except InputError as error:
                    if attempt == REOPEN_TRIES - 1:
                        log.error("%s", error)
                    await asyncio.sleep(REOPEN_WAIT_S)
        log.info("connections are possible again")

    def obey(self, order: dict[str, Any]) -> dict[str, Any]:
        """An order of whoever started the controller: ``{"do": ...}``; the answer.

        Raises:
            InputError: an order that does not exist.
        """
        match order:
            case {"do": "state"}:
                return self.state()
            case {"do": "fault", "name": str(name)}:
                schedule(self, name, order.get("after_s", 0.0), order.get("for_s"))
            case {"do": "recover"}:
                self.machine.recover()
                self.weather.clear()
                self.eye.mend_beam()
            case {"do": "stop"}:
                self.machine.end_program("stopped on demand")
                if not self.machine.arm.stands:
                    self.machine.arm.stop(4.0)
            case {"do": "set", **values}:
                self._set(values)
            case _:
                raise InputError(
                    "no such order", expected='{"do": "state" | "fault" | "recover" | "stop" | "set", ...}'
                )
        return {}

    def state(self) -> dict[str, Any]:
        """What is true, whatever the protocols say."""
        machine = self.machine
        q, qd = machine.arm.sample()
        X_ME = self.eye.truth()
        return {
            "time_s": machine.clock.now(),
            "commanded_q_rad": q.tolist(),
            "true_q_rad": self.eye.true_joints().tolist(),
            "X_ME": X_ME.tolist(),
            "speed_rad_s": qd.tolist(),
            "ever_moved": machine.arm.ever_moved,
            "moves": machine.arm.moves,
            "safety": machine.condition.safety.name.lower(),
            "robot_mode": int(machine.condition.mode),
            "runtime": machine.condition.runtime.name.lower(),
            "program": machine.program.name if machine.program else None,
            "remote_control": machine.condition.remote_control,
            "payload_kg": machine.payload_kg,
            "payload_cog_m": machine.payload_cog_m.tolist(),
            "tcp_offset": machine.tcp_offset.tolist(),
            "digital_outputs": machine.registers.digital_outputs,
            "popup": machine.condition.popup,
            "connections": sum(port.connections for port in self._ports),
        }

    def _set(self, values: dict[str, Any]) -> None:
        known = {"remote_control", "payload_kg", "payload_cog_m", "tcp_offset", "q_rad"}
        if not set(values) <= known:
            raise InputError("nothing of that name can be set", expected="some of " + ", ".join(sorted(known)))
        machine = self.machine
        if "remote_control" in values:
            machine.condition.remote_control = bool(values["remote_control"])
        if "payload_kg" in values or "payload_cog_m" in values:
            machine.set_payload(values.get("payload_kg", machine.payload_kg), values.get("payload_cog_m"))
        if "tcp_offset" in values:
            machine.set_tcp(values["tcp_offset"])
        if "q_rad" in values:
            machine.arm.place(joints_of(values["q_rad"], machine.kinematics))

    def _registers_written(self) -> None:
        program = self.machine.program
        if isinstance(program, ControlScript):
            program.registers_written()

    def _run(self, text: str) -> None:
        if text.lstrip().startswith("sec "):
            log.error("a secondary program was left out: it would run beside the other, which is not played here")
            return
        control = is_control_script(text)
        self.machine.run(ControlScript(self.machine, text) if control else OrdinaryProgram(self.machine, text))


def _point(numbers: Any) -> Any:
    point = np.array(numbers, float)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise InputError("no place for a tracker", expected="x, y, z in m", found=str(numbers))
    return point
