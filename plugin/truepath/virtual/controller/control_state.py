"""What the control script knows while it runs."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import numpy as np

from truepath.lie import Array
from truepath.virtual.controller.injected_path import PathStep
from truepath.virtual.controller.machine import Machine
from truepath.virtual.controller.progress_register import ProgressRegister

Done = Callable[[], None]


class ControlState:
    """Registers of its client, and what is under way.

    Args:
        machine: on which it runs.
        offset: of its registers: 0 or 24.

    Attributes:
        alive: False once the script has been ended.
        path: to be driven on request.
        moving_by_itself: whether an asynchronous move or stop is under way.
        speed_is_of_tool: of what ``speedl`` or ``speedj`` is the speed.
    """

    def __init__(self, machine: Machine, offset: int) -> None:
        self.machine, self.offset = machine, offset
        self.alive, self.moving_by_itself, self.speed_is_of_tool = True, False, False
        self.path: list[PathStep] = []
        self.progress = ProgressRegister()
        self._watchdog_s: float | None = None
        self._watchdog: asyncio.TimerHandle | None = None

    def int_in(self, number: int) -> int:
        return self.machine.registers.int_in(self.offset + number)

    def doubles(self, first: int, count: int) -> list[float]:
        return self.machine.registers.doubles_in(self.offset + first, count)

    def double(self, number: int) -> float:
        return self.doubles(number, 1)[0]

    def int_out(self, number: int) -> int:
        return self.machine.registers.output_ints[self.offset + number]

    def write_int(self, number: int, value: int) -> None:
        self.machine.registers.output_ints[self.offset + number] = value

    def write_progress(self, value: int) -> None:
        self.write_int(2, value)

    def write_doubles(self, first: int, values: Array) -> None:
        at = self.offset + first
        self.machine.registers.output_doubles[at : at + len(values)] = [float(value) for value in values]

    def answer(self, yes: bool) -> None:
        """A question that is answered by yes or no."""
        self.write_int(1, int(yes))

    @property
    def q(self) -> Array:
        """``(6,)`` joints now."""
        return self.machine.arm.sample()[0]

    @property
    def X_CT(self) -> Array:
        """``(4, 4)`` of the tool now."""
        return self.machine.kinematics.forward(self.q) @ self.machine.X_0T

    def inverse(self, X_CT: Array, q_near: Array | None = None) -> Array | None:
        """Joints ``(6,)`` at which the tool is there."""
        near = self.q if q_near is None else q_near
        return self.machine.kinematics.inverse(X_CT @ np.linalg.inv(self.machine.X_0T), near)

    # --- asynchronous moves

    def begin_by_itself(self) -> None:
        """An asynchronous move begins."""
        self.moving_by_itself = True
        self.write_progress(self.progress.started())

    def end_by_itself(self) -> None:
        """It has ended, or somebody ends it."""
        if self.alive and self.moving_by_itself:
            self.moving_by_itself = False
            self.write_progress(self.progress.finished())

    # --- watchdog

    def set_watchdog(self, least_frequency_hz: float) -> None:
        """From now on the client has to write at least that often."""
        self._watchdog_s = 1.0 / least_frequency_hz if least_frequency_hz > 0 else None
        self.note_sign_of_life()

    def note_sign_of_life(self) -> None:
        """The client has written."""
        if self._watchdog is not None:
            self._watchdog.cancel()
            self._watchdog = None
        if self._watchdog_s is not None and self.alive:
            self._watchdog = asyncio.get_running_loop().call_later(self._watchdog_s, self._bark)

    def _bark(self) -> None:
        if self.alive:
            self.machine.end_program("its client has fallen silent, as the watchdog noticed")
