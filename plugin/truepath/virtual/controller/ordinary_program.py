"""A program that is not ur_rtde's: the script runner says what to do, this does it."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from truepath.errors import InputError
from truepath.programs.motions import Kind
from truepath.virtual.controller.driving import drive
from truepath.virtual.controller.kinematics import pose_matrix, pose_vector
from truepath.virtual.controller.machine import Machine
from truepath.virtual.controller.motions import AtSpeed, Motion, Pursuit
from truepath.virtual.controller.planning import Leg, joints_of, pose_of
from truepath.virtual.controller.registers import DIGITAL
from truepath.virtual.controller.script_instructions import (
    Instruction,
    Message,
    Move,
    Output,
    ScriptError,
    SetOutput,
    SetPayload,
    SetTcp,
    SpeedJoints,
    Wait,
)
from truepath.virtual.controller.script_runner import run_script

MOST_BLENDED = 500  # moves that are looked at ahead; then the arm stops once
SERVO_LAG_S = 0.05
log = logging.getLogger(__name__)


class OrdinaryProgram:
    """One run.

    Args:
        machine: on which it runs.
        text: of the program.
    """

    def __init__(self, machine: Machine, text: str) -> None:
        found = re.search(r"^\s*def\s+(\w{1,60})", text, re.MULTILINE)
        self.name = found[1] if found else "a line"
        self._machine, self._text = machine, text
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Runs on its own from now on."""
        self._task = asyncio.create_task(self._run())

    def kill(self) -> None:
        """Nothing more happens."""
        if self._task is not None:
            self._task.cancel()

    async def _run(self) -> None:
        machine, fault = self._machine, None
        try:
            instructions = run_script(
                self._text,
                machine.arm.sample()[0].tolist(),
                machine.kinematics,
                self._answer,
                tool=machine.tcp_offset.tolist(),
            )
            await self._follow(instructions)
        except (ScriptError, InputError) as error:
            fault = str(error)
        except Exception as error:  # a program must not end without an end
            log.exception("program %s: a fault of the controller", self.name)
            fault = f"a fault of the controller: {error}"
        if fault is None:
            machine.program_ended(self)
            return
        log.error("program %s: %s", self.name, fault.replace("\n", ";"))
        machine.condition.popup = fault.splitlines()[0]
        machine.end_program("a fault")

    async def _follow(self, instructions: Iterator[Instruction]) -> None:
        waiting: list[Move] = []
        for instruction in instructions:
            await asyncio.sleep(0)  # others want to be served as well
            if isinstance(instruction, Move) and instruction.kind is not Kind.SERVO:
                waiting.append(instruction)
                if instruction.blend_m > 0 and len(waiting) < MOST_BLENDED:
                    continue
                await self._drive(waiting)
                waiting = []
                continue
            if waiting:
                await self._drive(waiting)
                waiting = []
            await self._obey(instruction)
        if waiting:
            await self._drive(waiting)
        if not self._machine.arm.stands:
            await self._stop(4.0)

    async def _drive(self, moves: list[Move]) -> None:
        done = asyncio.Event()
        drive(self._machine, [_leg(move, self._machine) for move in moves], done.set)
        await done.wait()

    async def _obey(self, instruction: Instruction) -> None:
        machine = self._machine
        if isinstance(instruction, Move):
            goal = joints_of(instruction.q_rad, machine.kinematics)
            await self._begin(Pursuit(*machine.arm.sample(), goal, SERVO_LAG_S), instruction.time_s or 0.0)
        elif isinstance(instruction, SpeedJoints):
            speeds = np.array(instruction.speed_rad_s)
            if not speeds.any():
                await self._stop(instruction.acceleration)
                return
            motion = AtSpeed(*machine.arm.sample(), speeds, max(instruction.acceleration, 1e-3))
            await self._begin(motion, instruction.time_s or 0.0)
        elif isinstance(instruction, Wait):
            await asyncio.sleep(machine.clock.wall_seconds(instruction.time_s))
        elif isinstance(instruction, SetTcp):
            machine.set_tcp(instruction.tool)
        elif isinstance(instruction, SetPayload):
            machine.set_payload(instruction.mass_kg, instruction.centre_m)
        elif isinstance(instruction, SetOutput):
            _set_output(machine, instruction)
        elif isinstance(instruction, Message):
            if instruction.popup:
                machine.condition.popup = instruction.text
            log.info("program %s says: %s", self.name, instruction.text[:200])

    async def _begin(self, motion: Motion, seconds: float) -> None:
        self._machine.arm.begin(motion)
        await asyncio.sleep(self._machine.clock.wall_seconds(seconds))

    async def _stop(self, deceleration: float) -> None:
        done = asyncio.Event()
        self._machine.arm.stop(deceleration, arrived=done.set)
        await done.wait()

    def _answer(self, name: str, arguments: tuple[Any, ...]) -> Any:
        """What the program asks of the robot; None: there is no such function."""
        machine = self._machine
        q, qd = machine.arm.sample()
        if name in ("get_actual_joint_positions", "get_target_joint_positions"):
            return q.tolist()
        if name in ("get_actual_joint_speeds", "get_target_joint_speeds"):
            return qd.tolist()
        if name in ("get_actual_tcp_pose", "get_target_tcp_pose"):
            return pose_vector(machine.kinematics.forward(q) @ machine.X_0T).tolist()
        if name == "get_actual_tool_flange_pose":
            return pose_vector(machine.kinematics.forward(q)).tolist()
        if name in ("get_target_payload", "get_payload"):
            return machine.payload_kg
        if name == "get_target_payload_cog":
            return machine.payload_cog_m.tolist()
        if name == "get_steptime":
            return 0.002
        if name == "is_steady":
            return machine.arm.stands
        if re.fullmatch(r"get_(standard|configurable|tool)_digital_in", name):
            return False
        if name in ("get_standard_analog_in", "get_tool_analog_in", "force"):
            return 0.0
        found = re.fullmatch(r"get_(standard|configurable|tool)_digital_out", name)
        if found and arguments and isinstance(arguments[0], int | float) and 0 <= arguments[0] < 8:
            bit = DIGITAL[f"{found[1]}_digital"] + int(arguments[0])
            return bool(machine.registers.digital_outputs >> bit & 1)
        return None


def _leg(move: Move, machine: Machine) -> Leg:
    stated = {"speed": move.speed, "acceleration": move.acceleration, "time_s": move.time_s, "blend_m": move.blend_m}
    if move.kind is Kind.JOINT:
        return Leg(joints_of(move.q_rad, machine.kinematics), **stated)  # type: ignore[arg-type]
    via = None if move.via is None else pose_matrix(move.via)[:3, 3]
    return Leg(pose_of(move.pose), via=via, follow=move.follows_orientation, **stated)  # type: ignore[arg-type]


def _set_output(machine: Machine, instruction: SetOutput) -> None:
    if instruction.kind is Output.ANALOGUE:
        if instruction.number in (0, 1):
            machine.registers.analogue_outputs[instruction.number] = min(max(instruction.value, 0.0), 1.0)
        return
    machine.registers.set_digital(instruction.kind.value, instruction.number, bool(instruction.value))
