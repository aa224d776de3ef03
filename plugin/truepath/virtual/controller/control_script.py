"""What ur_rtde's control script does on a robot: it waits for commands in registers and carries them out.

The script itself arrives over port 30003 and is recognised, not interpreted. Commands are numbered as in ur_rtde 1.6
(Lindvig et al., MIT licence); input register 0 holds the command, output register 0 says 1 (ready) or 2 (done).
"""

from __future__ import annotations

import logging
import re

from truepath.errors import InputError
from truepath.virtual.controller.control_commands import COMMANDS, CONTINUOUS
from truepath.virtual.controller.control_state import ControlState
from truepath.virtual.controller.injected_path import path_in
from truepath.virtual.controller.machine import Machine

READY, DONE = 1, 2
STOP_SCRIPT = 255
MARKS = ("def process_cmd(cmd):", "signal_done_with_cmd()", "read_input_integer_reg")
log = logging.getLogger(__name__)


def is_control_script(text: str) -> bool:
    """Whether a program is ur_rtde's, by what it consists of."""
    return all(mark in text for mark in MARKS)


class ControlScript:
    """The running script.

    Args:
        machine: on which it runs.
        text: as it arrived: with the path to be driven, if there is one.
    """

    name = "rtde_control"

    def __init__(self, machine: Machine, text: str) -> None:
        offset = re.search(r"reg_offset_int = # int register offset\n\s*(\d{1,2})\b", text)
        self._state = ControlState(machine, 24 if offset and offset[1] == "24" else 0)
        self._machine, self._text = machine, text
        self._busy = False

    def start(self) -> None:
        """Begins to wait for commands."""
        try:
            self._state.path = path_in(self._text)
        except InputError as error:
            self._fail(error)
            return
        self._state.write_progress(self._state.progress.finished())
        self._state.write_int(0, READY)

    def kill(self) -> None:
        """Nothing is answered any more."""
        self._state.alive = False

    def registers_written(self) -> None:
        """A client has written: a command, perhaps."""
        command = self._state.int_in(0)
        self._state.note_sign_of_life()
        if not self._state.alive:
            return
        if command in CONTINUOUS:
            self._carry_out(command, lambda: None)
            if self._state.alive:
                self._state.write_int(0, READY)
        elif command == 0:
            if not self._busy:
                self._state.write_int(0, READY)
        elif command == STOP_SCRIPT:
            self._state.alive = False
            self._machine.end_program("its client stopped it")
        elif not self._busy and self._state.int_out(0) != DONE:
            self._busy = True
            self._carry_out(command, self._done)

    def _carry_out(self, command: int, done: object) -> None:
        try:
            if command not in COMMANDS:
                raise InputError(f"command {command} of ur_rtde is not known to the virtual controller")
            COMMANDS[command](self._state, done)  # type: ignore[arg-type]
        except InputError as error:
            self._fail(error)

    def _done(self) -> None:
        if not self._state.alive:
            return
        self._busy = False
        self._state.write_int(0, READY if self._state.int_in(0) == 0 else DONE)

    def _fail(self, error: InputError) -> None:
        """As a runtime exception of a script does: the program ends, with a message."""
        self._machine.condition.popup = error.problem
        log.error("control script: %s", str(error).replace("\n", ";"))
        self._machine.end_program("a fault of the script")
