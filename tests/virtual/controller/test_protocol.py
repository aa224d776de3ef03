"""What the three ports answer, asked by hand from the published guides."""

import socket
import struct

import numpy as np
import pytest
from drawn_robot import HOME, SPEED_UP, TOOL, until
from rtde_by_hand import Rtde
from truepath.errors import InputError
from truepath.virtual.controller.injected_path import path_in
from truepath.virtual.controller.process import ControllerProcess

PROGRAM = """# two moves
def weave():
  set_payload(1.5, [0, 0, 0.05])
  movej([0.1, -1.5, 1.5, -1.5, -1.5, 0], a=1.4, v=1.0, r=0.01)
  if True:
    movel(pose_trans(get_forward_kin(), p[0, 0, -0.05, 0, 0, 0]), a=1.2, v=0.25)
  end
  set_standard_digital_out(2, True)
end
"""


@pytest.fixture
def rtde(quick):
    with Rtde(quick.address) as connection:
        yield connection


def send(quick, text):
    with socket.create_connection((quick.address, 30003), 5) as connection:
        connection.sendall(text.encode())


def asked(quick, *questions):
    with socket.create_connection((quick.address, 29999), 5) as connection, connection.makefile() as lines:
        lines.readline()
        connection.sendall("".join(question + "\n" for question in questions).encode())
        return [lines.readline().strip() for _ in questions]


@pytest.mark.parametrize("address", ["0.0.0.0", "192.168.1.5", "localhost", "::1", "", "127.1", "8.8.8.8"])
def test_only_a_loopback_address_is_listened_on(address):
    with pytest.raises(InputError, match="this machine only"):
        ControllerProcess(address)


def test_an_address_that_is_taken_is_refused(quick):
    with pytest.raises(InputError, match="cannot be opened"), ControllerProcess(quick.address):
        pass


def test_time_stamps_are_a_period_apart_at_any_rate(rtde):
    for rate in (10.0, 125.0, 500.0):
        rtde.start(["timestamp"], rate)
        stamps = [rtde.sample()["timestamp"] for _ in range(int(min(rate, 100) / 4))]
        rtde.ask("P")
        assert np.allclose(np.diff(stamps), SPEED_UP / rate, atol=1e-9)


def test_no_sample_of_a_moving_robot_is_left_out(quick, rtde):
    quick.command({"do": "set", "q_rad": HOME})
    send(quick, "def far():\n  movej([0.9, -1.5, 1.5, -1.5, -1.5, 0], a=1.4, v=0.2)\nend\n")
    rtde.start(["timestamp", "actual_q", "actual_TCP_pose", "target_moment"], 500.0)
    samples = [rtde.sample() for _ in range(250)]
    assert np.allclose(np.diff([sample["timestamp"] for sample in samples]), SPEED_UP / 500, atol=1e-9)
    assert samples[-1]["actual_q"][0] > samples[0]["actual_q"][0] + 0.1
    quick.command({"do": "stop"})


def test_the_state_of_the_robot_can_be_read(quick, rtde, drawn):
    quick.command({"do": "set", "q_rad": HOME, "tcp_offset": TOOL})
    types = {
        "actual_q": "VECTOR6D", "target_q": "VECTOR6D", "actual_TCP_pose": "VECTOR6D", "joint_temperatures": "VECTOR6D",
        "payload": "DOUBLE", "payload_cog": "VECTOR3D", "tcp_offset": "VECTOR6D", "safety_status_bits": "UINT32",
        "robot_mode": "INT32", "runtime_state": "UINT32", "robot_status_bits": "UINT32", "speed_scaling": "DOUBLE",
        "target_moment": "VECTOR6D",
    }  # fmt: skip
    assert rtde.outputs(list(types)) == (1, list(types.values()))
    rtde.ask("S")
    told = rtde.sample()
    assert np.allclose(told["actual_q"], HOME)
    assert np.allclose(told["actual_TCP_pose"][:3], drawn.tool(HOME, TOOL).translation())
    assert np.allclose(told["tcp_offset"], TOOL)
    assert (told["safety_status_bits"], told["robot_mode"], told["runtime_state"]) == (1, 7, 1)
    assert told["speed_scaling"] == 1.0
    assert 20 < min(told["joint_temperatures"]) <= max(told["joint_temperatures"]) < 60
    # Upper arm, forearm and tool are held by the shoulder: tens of newton metres, of which the base joint feels none.
    assert abs(told["target_moment"][0]) < 1e-9
    assert 10 < abs(told["target_moment"][1]) < 100


def test_an_unknown_variable_is_not_found_and_nothing_starts(rtde):
    assert rtde.outputs(["timestamp", "colour_of_the_robot"]) == (0, ["DOUBLE", "NOT_FOUND"])
    assert rtde.ask("S") == b"\x00"
    assert rtde.inputs(["colour_of_the_robot"]) == (0, ["NOT_FOUND"])


def test_recipes_are_numbered_and_a_register_belongs_to_one_client(quick, rtde):
    assert rtde.inputs(["input_int_register_30"]) == (1, ["INT32"])
    assert rtde.inputs(["input_double_register_30", "input_int_register_30"]) == (2, ["DOUBLE", "INT32"])
    with Rtde(quick.address) as other:
        assert other.inputs(["input_int_register_30"]) == (0, ["IN_USE"])
    rtde.socket.sendall(struct.pack(">HBBdi", 16, ord("U"), 2, 2.5, -7))
    with Rtde(quick.address) as other:
        other.start(["input_double_register_30", "input_int_register_30"])
        until(lambda: list(other.sample().values()) == [2.5, -7])


def test_the_dashboard_answers(quick):
    version, serial, remote, mode, unknown = asked(
        quick, "PolyscopeVersion", "get serial number", "is in remote control", "robotmode", "make coffee"
    )
    assert version.startswith("URSoftware 5.13")
    assert serial.isdigit()
    assert (remote, mode) == ("true", "Robotmode: RUNNING")
    assert "could not understand" in unknown
    quick.command({"do": "set", "remote_control": False})
    assert asked(quick, "is in remote control") == ["false"]
    quick.command({"do": "set", "remote_control": True})


def test_an_ordinary_program_moves_the_robot_sets_what_it_sets_and_ends(quick, state, drawn):
    quick.command({"do": "set", "q_rad": HOME, "tcp_offset": TOOL})
    send(quick, PROGRAM)
    until(lambda: state()["program"] == "weave")
    until(lambda: state()["runtime"] == "stopped")
    told = state()
    assert told["popup"] is None
    assert (told["payload_kg"], told["digital_outputs"]) == (1.5, 4)
    ahead = drawn.tool([0.1, -1.5, 1.5, -1.5, -1.5, 0], TOOL)
    shift = ahead.inverse() @ drawn.tool(told["commanded_q_rad"], TOOL)
    assert np.allclose(shift.translation(), [0, 0, -0.05], atol=1e-7)


def test_a_program_is_paused_and_goes_on_and_is_stopped_from_the_dashboard(quick, state):
    quick.command({"do": "set", "q_rad": HOME})
    send(quick, "def far():\n  movej([1.5, -1.5, 1.5, -1.5, -1.5, 0], a=1.4, v=0.2)\nend\n")
    until(lambda: abs(state()["speed_rad_s"][0]) > 0.1)
    assert asked(quick, "running", "pause", "programState") == [
        "Program running: true", "Pausing program", "PAUSED far",
    ]  # fmt: skip
    at = state()["commanded_q_rad"]
    assert state()["commanded_q_rad"] == at
    assert asked(quick, "play") == ["Starting program"]
    until(lambda: abs(state()["speed_rad_s"][0]) > 0.1)
    assert asked(quick, "stop", "running") == ["Stopped", "Program running: false"]
    until(lambda: np.allclose(state()["speed_rad_s"], 0))
    assert 0 < state()["commanded_q_rad"][0] < 1.4


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("def p():\n  movej([0, 0], a=1, v=1)\nend\n", ""),
        ("def p():\n  movel(p[3, 0, 0, 0, 0, 0])\nend\n", ""),
        ("def p():\n  x = undefined_thing(3)\nend\n", ""),
        ("))) no program\n", ""),
        ("def p():\n  movej([0, -1.5, 1.5, 0, 0, 0], a=0, v=0)\nend\n", ""),
    ],
)
def test_a_program_with_a_fault_ends_with_a_message_and_moves_nothing(quick, state, text, reason):
    quick.command({"do": "set", "q_rad": HOME})
    quick.command({"do": "recover"})
    send(quick, text)
    until(lambda: state()["popup"] is not None)
    assert state()["runtime"] == "stopped"
    assert state()["commanded_q_rad"] == HOME


def test_a_secondary_program_leaves_the_other_alone(quick, state):
    quick.command({"do": "set", "q_rad": HOME})
    send(quick, "def far():\n  movej([0.5, -1.5, 1.5, -1.5, -1.5, 0], a=1.4, v=0.2)\nend\n")
    until(lambda: state()["program"] == "far")
    send(quick, "sec beside():\n  set_standard_digital_out(1, True)\nend\n")
    until(lambda: any("secondary program" in line for line in quick.log()))
    until(lambda: state()["runtime"] == "stopped")
    assert state()["commanded_q_rad"][0] == 0.5


def test_no_program_starts_while_the_robot_is_stopped(quick, state):
    quick.command({"do": "fault", "name": "protective_stop"})
    until(lambda: state()["safety"] == "protective_stop")
    moves = state()["moves"]
    send(quick, PROGRAM)
    until(lambda: any("program weave refused" in line for line in quick.log()))
    assert state()["moves"] == moves
    quick.command({"do": "recover"})


def test_an_injected_path_is_read_step_by_step():
    script = """def exec_move_path():
  textmsg("exec_move_path")
  # inject move path
\tsignal_async_progress(0)
\tmovej([0.1,-1.5,1.5,-1.5,-1.5,1e-05],a=1.4,v=1,r=0.02)
\tmovel(p[-0.5,.1,0.3,0,3.14,0],a=1.2,v=0.25,r=0)
end
"""
    first, second = path_in(script)
    assert (first.joint, first.is_pose, first.progress, first.target[5]) == (True, False, 0, 1e-05)
    assert (second.joint, second.is_pose, second.progress) == (False, True, None)
    assert (second.acceleration, second.speed, second.blend_m) == (1.2, 0.25, 0.0)
    assert path_in(script.replace("# inject move path", "")) == []


@pytest.mark.parametrize("line", ["movej([1,2,3],a=1,v=1,r=0)", "set_tcp(p[0,0,0,0,0,0])", "movej(x,a=1,v=1,r=0)"])
def test_a_line_of_a_path_that_is_no_step_is_refused(line):
    with pytest.raises(InputError, match="step of a path"):
        path_in(f"# inject move path\n\t{line}\nend\n")
