"""The controller itself: arm, state, tool and payload, and what stops or frees the robot."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array
from truepath.virtual.controller.arm import Arm
from truepath.virtual.controller.clock import Clock
from truepath.virtual.controller.condition import Condition, RobotMode, Runtime, Safety
from truepath.virtual.controller.kinematics import NominalKinematics, pose_matrix
from truepath.virtual.controller.motions import Rest
from truepath.virtual.controller.registers import Registers

PROTECTIVE_DECELERATION, EMERGENCY_DECELERATION = 20.0, 40.0  # rad/s^2, of the leading joint
MOST_TOOL_M, MOST_PAYLOAD_KG, MOST_CENTRE_M = 10.0, 200.0, 4.0
UNLOCK_AFTER_S = 5.0  # a UR refuses to unlock sooner
log = logging.getLogger(__name__)


class Program(Protocol):
    """Something that runs on the controller."""

    name: str

    def start(self) -> None:
        """Begins; it calls ``Machine.program_ended`` when it is through."""

    def kill(self) -> None:
        """Ends it at once, without another word; the arm is stopped by whoever kills it."""


class Machine:
    """One robot with its controller.

    Args:
        kinematics: nominal.
        clock: of the robot.
        payload_kg, payload_cog_m, tcp_offset: as set in the installation; by default what the cell's drawing says.

    Attributes:
        kinematics, clock, arm, condition: see their classes.
        registers: what the protocols write and read.
        payload_kg, payload_cog_m, tcp_offset: in force; X_0T as six numbers.
        inertia: ``(6,)`` of the payload, as it was set.

    Raises:
        InputError: a payload or a tool that no robot can have.
    """

    def __init__(
        self,
        kinematics: NominalKinematics,
        clock: Clock,
        payload_kg: float | None = None,
        payload_cog_m: Sequence[float] | None = None,
        tcp_offset: Sequence[float] | None = None,
    ) -> None:
        from truepath.virtual.controller.kinematics import pose_vector

        self.kinematics, self.clock = kinematics, clock
        self.arm = Arm(kinematics, clock, kinematics.home_rad)
        self.arm.fault = self.protective_stop
        self.condition = Condition()
        self.registers = Registers()
        self.program: Program | None = None
        self.inertia = np.zeros(6)
        mass, centre, X_0T = kinematics.tool_on_it()
        self.set_payload(mass if payload_kg is None else payload_kg, centre if payload_cog_m is None else payload_cog_m)
        self.set_tcp(pose_vector(X_0T) if tcp_offset is None else tcp_offset)

    # --- tool and payload

    def set_payload(self, mass_kg: float, centre_m: Sequence[float] | Array | None) -> None:
        """Mass and centre ``(3,)`` in 0; the centre stays without one.

        Raises:
            InputError: not what a robot can carry.
        """
        if not (math.isfinite(mass_kg) and 0 <= mass_kg <= MOST_PAYLOAD_KG):
            raise InputError("no such payload", expected=f"0 to {MOST_PAYLOAD_KG:g} kg", found=f"{mass_kg} kg")
        if centre_m is not None:
            self.payload_cog_m = _vector(centre_m, 3, MOST_CENTRE_M, "centre of a payload")
        self.payload_kg = float(mass_kg)

    def set_tcp(self, pose: Sequence[float] | Array) -> None:
        """X_0T as six numbers.

        Raises:
            InputError: no pose of a tool.
        """
        self.tcp_offset = _vector(pose, 6, MOST_TOOL_M, "pose of a tool")
        self.X_0T = pose_matrix(self.tcp_offset)

    # --- programs

    def run(self, program: Program) -> None:
        """Starts a program, ending the one that runs; refused with a line in the log while the robot is stopped."""
        if not self.condition.may_move:
            log.warning(
                "program %s refused: robot mode %s, %s",
                program.name,
                self.condition.mode.name,
                self.condition.safety.name,
            )
            return
        self.end_program("replaced by another program")
        self.program, self.condition.runtime, self.condition.popup = program, Runtime.PLAYING, None
        log.info("program %s starts", program.name)
        program.start()

    def end_program(self, why: str, deceleration: float = 4.0) -> None:
        """Ends what runs, if anything does; the arm comes to rest."""
        program, self.program = self.program, None
        if program is None:
            return
        log.info("program %s ends: %s", program.name, why)
        program.kill()
        if self.condition.runtime is Runtime.PAUSED or not self.arm.stands:
            self.arm.stop(deceleration)
        self._set_stopped()

    def program_ended(self, program: Program) -> None:
        """For the program itself: it is through."""
        if self.program is program:
            log.info("program %s is through", program.name)
            self.program = None
            self._set_stopped()

    def _set_stopped(self) -> None:
        if self.condition.runtime is Runtime.PAUSED:
            self.arm.set_rate(self.registers.speed_slider)
        self.condition.runtime = Runtime.STOPPED

    def pause(self) -> bool:
        """Holds the program where it is."""
        if self.condition.runtime is not Runtime.PLAYING:
            return False
        self.condition.runtime = Runtime.PAUSED
        self.arm.set_rate(0.0)
        return True

    def resume(self) -> bool:
        """Goes on after a pause."""
        if self.condition.runtime is not Runtime.PAUSED or not self.condition.may_move:
            return False
        self.condition.runtime = Runtime.PLAYING
        self.arm.set_rate(self.registers.speed_slider)
        return True

    def speed_slider_moved(self) -> None:
        """Motions follow the slider from now on."""
        if self.condition.runtime is not Runtime.PAUSED:
            self.arm.set_rate(self.registers.speed_slider)

    # --- safety

    def protective_stop(self, reason: str) -> None:
        """The robot stops itself; a person, or the dashboard, has to unlock it."""
        if self.condition.safety is not Safety.NORMAL:
            return
        log.warning("protective stop: %s", reason)
        self.condition.safety, self.condition.stopped_at_s = Safety.PROTECTIVE_STOP, self.clock.now()
        self._halt("protective stop", PROTECTIVE_DECELERATION)

    def emergency_stop(self) -> None:
        """The button is pressed: power is cut."""
        log.warning("emergency stop")
        self.condition.safety, self.condition.mode = Safety.EMERGENCY_STOP, RobotMode.POWER_OFF
        self._halt("emergency stop", EMERGENCY_DECELERATION)

    def unlock(self) -> str | None:
        """After a protective stop; None if done, else why not."""
        if self.condition.safety is not Safety.PROTECTIVE_STOP:
            return "Cannot unlock protective stop: the robot is in none"
        if self.clock.now() - self.condition.stopped_at_s < UNLOCK_AFTER_S:
            return "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop"
        self.condition.safety = Safety.NORMAL
        return None

    def release_emergency_stop(self) -> None:
        """The button is pulled out again; the robot stays without power."""
        if self.condition.safety is Safety.EMERGENCY_STOP:
            self.condition.safety = Safety.NORMAL

    def power(self, mode: RobotMode) -> bool:
        """Power on (IDLE), brakes released (RUNNING), power off; whether the robot obeys."""
        if self.condition.safety is Safety.EMERGENCY_STOP:
            return False
        if mode is not RobotMode.RUNNING:
            self._halt("power off", EMERGENCY_DECELERATION)
        elif self.condition.mode is RobotMode.POWER_OFF:
            return False
        self.condition.mode = mode
        return True

    def recover(self) -> None:
        """What a person does after any stop, all at once: unlock, power on, release the brakes."""
        self.condition.safety, self.condition.mode = Safety.NORMAL, RobotMode.RUNNING
        self.condition.popup = None

    def restart(self) -> None:
        """Everything that a controller forgets when it is switched off and on; the arm stands where it stood."""
        self._halt("restart", EMERGENCY_DECELERATION)
        self.arm.begin(Rest(self.arm.sample()[0]))
        remote, self.condition = self.condition.remote_control, Condition()
        self.condition.remote_control = remote
        self.registers.clear()
        self.arm.set_rate(1.0)

    def _halt(self, why: str, deceleration: float) -> None:
        self.end_program(why, deceleration)
        if not self.arm.stands:
            self.arm.stop(deceleration)


def _vector(numbers: Sequence[float] | Array, size: int, most: float, what: str) -> Array:
    vector = np.array(numbers, float)
    if vector.shape != (size,) or not np.isfinite(vector).all() or np.abs(vector).max() > most:
        raise InputError(f"no {what}", expected=f"{size} numbers, {most:g} at most", found=str(list(numbers)))
    return vector
