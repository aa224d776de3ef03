"""Port 29999: the dashboard, one question a line."""

from __future__ import annotations

import re
from collections.abc import Callable

from truepath.virtual.controller.addresses import DASHBOARD_PORT
from truepath.virtual.controller.condition import RobotMode, Runtime
from truepath.virtual.controller.guarded_server import Connection, GuardedServer
from truepath.virtual.controller.machine import Machine
from truepath.virtual.controller.rtde_port import CONTROL_VERSION
from truepath.virtual.controller.wire import ProtocolError

MOST_LINE = 4096
SERIAL_NUMBER = "20240000001"


class DashboardPort(GuardedServer):
    """Answers questions and obeys the few orders that need no screen.

    Args:
        address: loopback.
        machine: of which it tells.
    """

    def __init__(self, address: str, machine: Machine) -> None:
        super().__init__("dashboard", address, DASHBOARD_PORT, MOST_LINE)
        self._machine = machine

    async def serve(self, connection: Connection) -> None:
        connection.send(b"Connected: Universal Robots Dashboard Server\n")
        while line := await connection.line():
            if not line.endswith("\n"):
                raise ProtocolError("it left in the middle of a line")
            question = line.strip()
            if question == "quit":
                connection.send(b"Disconnected\n")
                return
            connection.send(self._answer(question).encode() + b"\n")

    def _answer(self, question: str) -> str:
        for pattern, answer in _ANSWERS:
            if re.fullmatch(pattern, question, re.IGNORECASE):
                return answer(self._machine)
        return f'could not understand: "{question[:200]}"'


def _version(machine: Machine) -> str:
    return "URSoftware {}.{}.{}.{}".format(*CONTROL_VERSION)


def _stop(machine: Machine) -> str:
    machine.end_program("stopped from the dashboard")
    return "Stopped"


def _play(machine: Machine) -> str:
    return "Starting program" if machine.resume() else "Failed to execute: play"


def _pause(machine: Machine) -> str:
    return "Pausing program" if machine.pause() else "Failed to execute: pause"


def _unlock(machine: Machine) -> str:
    return machine.unlock() or "Protective stop releasing"


def _power(mode: RobotMode, done: str) -> Callable[[Machine], str]:
    return lambda machine: done if machine.power(mode) else "Power cannot be changed in this state"


def _program_state(machine: Machine) -> str:
    name = machine.program.name if machine.program else "<unnamed>"
    return f"{machine.condition.runtime.name} {name}"


def _popup_closed(machine: Machine) -> str:
    machine.condition.popup = None
    return "closing popup"


def _popup(machine: Machine) -> str:
    return "showing popup"


_ANSWERS: list[tuple[str, Callable[[Machine], str]]] = [
    ("PolyscopeVersion", _version),
    ("version", lambda machine: "{}.{}.{}".format(*CONTROL_VERSION)),
    ("get serial number", lambda machine: SERIAL_NUMBER),
    ("get robot model", lambda machine: machine.kinematics.name.upper()),
    ("is in remote control", lambda machine: str(machine.condition.remote_control).lower()),
    ("stop", _stop),
    ("play", _play),
    ("pause", _pause),
    (
        "running",
        lambda machine: f"Program running: {str(machine.condition.runtime is Runtime.PLAYING).lower()}",
    ),
    ("programState", _program_state),
    ("get loaded program", lambda machine: "No program loaded"),
    ("isProgramSaved", lambda machine: "true <unnamed>"),
    ("robotmode", lambda machine: f"Robotmode: {machine.condition.mode.name}"),
    ("safetymode", lambda machine: f"Safetymode: {machine.condition.safety.dashboard_name}"),
    ("safetystatus", lambda machine: f"Safetystatus: {machine.condition.safety.dashboard_name}"),
    ("unlock protective stop", _unlock),
    ("power on", _power(RobotMode.IDLE, "Powering on")),
    ("power off", _power(RobotMode.POWER_OFF, "Powering off")),
    ("brake release", _power(RobotMode.RUNNING, "Brake releasing")),
    ("close popup", _popup_closed),
    ("close safety popup", lambda machine: "closing safety popup"),
    ("popup .*", _popup),
    ("addToLog .*", lambda machine: "Added log message"),
]
