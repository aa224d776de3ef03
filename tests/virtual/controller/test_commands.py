"""Commands in the registers of a running control script: whatever they are, the controller survives them."""

import asyncio
import math

import numpy as np
import pytest
from drawn_robot import HOME
from truepath.virtual.controller.clock import Clock
from truepath.virtual.controller.control_commands import COMMANDS
from truepath.virtual.controller.control_script import ControlScript, is_control_script
from truepath.virtual.controller.kinematics import NominalKinematics
from truepath.virtual.controller.machine import Machine
from truepath.virtual.controller.progress_register import ProgressRegister

SCRIPT = """def rtde_control():
  global reg_offset_int = # int register offset
{offset}
  def exec_move_path():
    # inject move path
  end
  def process_cmd(cmd):
    read_input_integer_reg(0)
    signal_done_with_cmd()
  end
end
"""
STRANGE = [0.0, -1.0, 1e-300, 1e300, math.nan, math.inf, -math.inf, 3.0, 1e-9]


@pytest.fixture(scope="module")
def kinematics():
    return NominalKinematics("ur5_cell")


def run(kinematics, work, offset=0):
    """Lets ``work(machine, command)`` do something with a running script on an event loop."""

    async def session():
        machine = Machine(kinematics, Clock(50.0))

        def command(number, doubles=(), asynchronous=0):
            written = {f"input_double_register_{offset + k}": value for k, value in enumerate(doubles)}
            written |= {f"input_int_register_{offset}": number, f"input_int_register_{offset + 1}": asynchronous}
            machine.registers.write(written)
            if isinstance(machine.program, ControlScript):
                machine.program.registers_written()

        broken = []
        asyncio.get_running_loop().set_exception_handler(lambda loop, context: broken.append(context))
        machine.run(ControlScript(machine, SCRIPT.format(offset=offset)))
        await work(machine, command)
        assert broken == []

    asyncio.run(session())


def test_it_is_recognised_by_what_it_consists_of():
    assert is_control_script(SCRIPT)
    assert not is_control_script("def weld():\n  movej([0, 0, 0, 0, 0, 0])\nend\n")


@pytest.mark.parametrize("offset", [0, 24])
def test_a_command_is_done_once_and_ready_again_when_it_is_cleared(kinematics, offset):
    async def work(machine, command):
        out = machine.registers.output_ints
        assert out[offset] == 1
        command(1, [*HOME[:5], 0.2, 1.0, 1.4])
        assert out[offset] == 1  # under way
        while out[offset] != 2:
            await asyncio.sleep(0.005)
        command(1, [*HOME, 1.0, 1.4])
        assert out[offset] == 2  # not a second time
        command(0)
        assert out[offset] == 1
        assert machine.arm.sample()[0][5] == pytest.approx(0.2)

    run(kinematics, work, offset)


@pytest.mark.parametrize("number", [*COMMANDS, 5, 72, -1, 2**31 - 1])
def test_no_numbers_bring_it_down(kinematics, number):
    dice = np.random.default_rng(abs(number))

    async def work(machine, command):
        for _ in range(6):
            if machine.program is None:
                machine.recover()
                machine.run(ControlScript(machine, SCRIPT.format(offset=0)))
            command(number, dice.choice(STRANGE, 18).tolist(), int(dice.integers(2)))
            await asyncio.sleep(0.002)
            q, qd = machine.arm.sample()
            assert np.isfinite([q, qd]).all()
            command(0)
        machine.end_program("the test is over")

    run(kinematics, work)


def test_a_sample_that_is_asked_for_late_is_one_of_when_it_was_due(kinematics):
    async def work(machine, command):
        command(1, [*HOME[:5], 1.5, 1.0, 1.4])
        await asyncio.sleep(0.01)
        moment = machine.clock.now()
        there, speed = machine.arm.sample(moment)
        assert 0 < there[5] < 1.5
        command(0)
        while machine.registers.output_ints[0] != 1:
            await asyncio.sleep(0.005)
        machine.arm.place(np.zeros(6))
        assert np.array_equal(machine.arm.sample(moment), [there, speed])
        assert np.array_equal(machine.arm.sample()[0], np.zeros(6))

    run(kinematics, work)


def test_an_unknown_command_ends_the_script_and_says_so(kinematics):
    async def work(machine, command):
        command(6)
        assert machine.program is None
        assert "command 6" in machine.condition.popup

    run(kinematics, work)


def test_the_watchdog_ends_a_script_whose_client_has_fallen_silent(kinematics):
    async def work(machine, command):
        command(35, [50.0])
        command(0)
        await asyncio.sleep(0.005)
        assert machine.program is not None
        await asyncio.sleep(0.1)
        assert machine.program is None

    run(kinematics, work)


def test_the_progress_of_asynchronous_moves_is_packed_into_one_register():
    register = ProgressRegister()
    fields = [(value >> 24, value >> 16 & 0x7F, value >> 15 & 1, value & 0x7FFF) for value in (
        register.finished(), register.started(), register.reached(3), register.reached(40000), register.finished(),
        register.started(),
    )]  # fmt: skip
    assert fields == [(0, 1, 0, 0), (1, 2, 1, 0), (1, 3, 1, 3), (1, 4, 1, 32767), (1, 5, 0, 0), (2, 6, 1, 0)]
    for _ in range(1000):
        assert 0 <= register.started() < 2**31
