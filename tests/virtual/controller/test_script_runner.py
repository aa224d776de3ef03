"""The script runner: what ordinary programs tell a robot, and that no text whatever can do more than fail.

Truth: calculated by hand, the corpus of programs that was written together with its numbers, and Drake's kinematics.
"""

import json
import time
from contextlib import suppress
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from truepath.plants import models_dir
from truepath.programs.motions import Kind
from truepath.virtual.controller.kinematics import NominalKinematics, pose_matrix
from truepath.virtual.controller.script_instructions import (
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

HOME = [0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0]
CORPUS = Path(__file__).parents[2] / "programs" / "corpus"
WELD = (models_dir() / "ur5" / "weld.script").read_text()
KINDS = {"joint": Kind.JOINT, "linear": Kind.LINEAR, "process": Kind.PROCESS, "arc": Kind.ARC, "servo": Kind.SERVO}
SAME_EVERY_TIME = [
    "arrays_of_poses",
    "crossed_forms",
    "expressions",
    "joints_in_degrees",
    "pose_algebra",
    "walrus_offsets",
    "circular_welds",
    "grid_pose_trans",
    "unit_helpers",
    "robodk_frame_weld",
    "nested_functions",
]


@pytest.fixture(scope="module")
def arm():
    return NominalKinematics("ur5")


@pytest.fixture
def told(arm):
    """Function: all that a program tells the robot, at most ``most`` instructions; without sensors."""

    def told(text, ask=lambda name, arguments: None, most=10_000, **options):
        return list(islice(run_script(text, HOME, arm, ask, **options), most))

    return told


def in_program(*lines):
    return "def program():\n" + "\n".join(f"  {line}" for line in lines) + "\nend\n"


def flange(pose, tool):
    return pose_matrix(pose) @ np.linalg.inv(pose_matrix(tool))


# What programs tell


def test_the_weld_program_tells_what_is_written_in_it(told):
    instructions = told(WELD)
    assert instructions[0] == SetTcp(4, (0.08, 0.0, 0.16, 0.0, 0.0, 0.0))
    assert instructions[1] == SetPayload(5, 0.86, (0.05, 0.0, 0.037))
    moves = [each for each in instructions if isinstance(each, Move)]
    assert [move.kind for move in moves] == [0, 1, 1, 1, 1, 1, 1, 1, 1, 1, 4, 4, 1, 0]
    assert moves[0].q_rad == pytest.approx(HOME)
    assert (moves[0].acceleration, moves[0].speed) == (1.4, 1.05)
    assert moves[1].pose == pytest.approx((-0.525, -0.15, 0.163, -2.221441469, -2.221441469, 0))
    assert (moves[1].acceleration, moves[1].speed, moves[1].blend_m) == (1.2, 0.25, 0.01)
    assert moves[10].via == pytest.approx((-0.6, 0.04, 0.113, -2.221441469, -2.221441469, 0))
    lights = [each for each in instructions if isinstance(each, SetOutput)]
    assert [(each.kind, each.number, each.value) for each in lights] == [(Output.DIGITAL, 0, v) for v in (1, 0, 1, 0)]
    assert [each.time_s for each in instructions if isinstance(each, Wait)] == [0.2] * 4


def test_joints_at_a_pose_are_those_with_which_drake_puts_the_tool_there(told, arm):
    for move in (each for each in told(WELD) if isinstance(each, Move)):
        X = arm.forward(np.array(move.q_rad)) @ pose_matrix(move.tool)
        assert np.abs(X - pose_matrix(move.pose)).max() < 1e-8


@pytest.mark.parametrize("name", SAME_EVERY_TIME)
def test_programs_of_the_corpus_go_where_they_were_written_to_go(told, name):
    """No target of these depends on a sensor; each line has one."""
    expected = json.loads((CORPUS / "expected" / f"{name}.json").read_text())["targets"]
    known = {(target["line"], KINDS.get(target["kind"])): target for target in expected}
    moves = [each for each in told((CORPUS / f"{name}.script").read_bytes().decode()) if isinstance(each, Move)]
    met = [(move, known[move.line, move.kind]) for move in moves if (move.line, move.kind) in known]
    assert len(met) >= 4
    for move, target in met:
        if "joints" in target:
            assert move.q_rad == pytest.approx(target["joints"], abs=1e-9)
        else:
            assert np.abs(flange(move.pose, move.tool) - flange(target["pose"], target["tool"])).max() < 1e-8


def test_what_is_not_stated_is_as_the_manual_says(told):
    joint, line = told(in_program("movej([0,-1,1,-1,-1,0])", "movel(p[-0.5,-0.1,0.3,0,3.1,0])"))
    assert (joint.speed, joint.acceleration, joint.blend_m, joint.time_s) == (1.05, 1.4, 0.0, None)
    assert (line.speed, line.acceleration) == (0.25, 1.2)


def test_a_stated_time_a_stop_and_messages(told):
    lines = ["movej([0,-1,1,-1,-1,0], t=2.5)", "stopj(3)", 'textmsg("a#b = ", 1.5)', 'popup("look")']
    move, stop, said, shown = told(in_program(*lines))
    assert move.time_s == 2.5
    assert stop == SpeedJoints(3, (0.0,) * 6, 3.0, None)
    assert said == Message(4, "a#b = 1.5", False)
    assert shown == Message(5, "look", True)


def test_expressions_are_computed_as_by_hand(told):
    lines = ["x = 2 + 3*4 - 6/3", "y = [1, 2, 3]", "y[1] = x", "z = y", "z[0] = 7", "if x == 12 and not False:",
             "sleep(y[0] + y[1] + norm([3, 4]) + floor(2.7))", "else:", "sleep(99)", "end"]  # fmt: skip
    assert told(in_program(*lines)) == [Wait(8, 1 + 12 + 5 + 2)]


def test_functions_loops_and_returns(told):
    lines = ["def double(x):", "return 2*x", "end", "n = 0", "while True:", "n = n + 1", "if n == 2:", "continue",
             "end", "if n > 4:", "break", "end", "sleep(double(n))", "end"]  # fmt: skip
    assert [each.time_s for each in told(in_program(*lines))] == [2, 6, 8]


def test_the_pose_of_joints_is_that_of_the_tool_in_force(told, arm):
    tool = [0.02, 0.01, 0.2, 0.1, 0.2, 0.3]
    (move,) = told(in_program("movel(get_forward_kin([0,-1.2,1.1,-1.4,-1.5,0]))"), tool=tool)
    X = arm.forward(np.array([0, -1.2, 1.1, -1.4, -1.5, 0])) @ pose_matrix(tool)
    assert np.abs(pose_matrix(move.pose) - X).max() < 1e-9


def test_sensors_are_asked_when_the_program_is_there_and_not_before(arm):
    asked = []

    def ask(name, arguments):
        asked.append((name, arguments))
        return len(asked) > 1

    lines = ["sleep(1)", "while not get_standard_digital_in(3):", "sleep(0.5)", "end", "sleep(2)"]
    run = run_script(in_program(*lines), HOME, arm, ask)
    assert next(run).time_s == 1
    assert asked == []
    assert next(run).time_s == 0.5
    assert asked == [("get_standard_digital_in", (3,))]
    assert next(run).time_s == 2
    with pytest.raises(StopIteration):
        next(run)


def test_threads_take_turns_while_the_program_waits(told):
    lines = ["thread blink():", "while True:", "set_digital_out(1, True)", "sleep(0.1)", "end", "end",
             "h = run blink()", "sleep(0.35)", "kill h", "sleep(5)"]  # fmt: skip
    instructions = told(in_program(*lines))
    waits = [each.time_s for each in instructions if isinstance(each, Wait)]
    assert sum(waits) == pytest.approx(5.35)
    assert sum(isinstance(each, SetOutput) for each in instructions) == 4  # after 0.008, 0.1, 0.2 and 0.3 s or so


# What cannot be run


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "0 programs"),
        ("def a():\nend\ndef b():\nend", "2 programs"),
        ("def a():\n sleep(1)\n", "an end is missing"),
        ("end", "an end too many"),
        (in_program("movej([0,0,0])"), "six numbers"),
        (in_program("movel(p[-9,0,0,0,0,0])"), "cannot reach"),
        (in_program("movej([0,0,0,0,0,0], v=0)"), "more than zero"),
        (in_program("sleep(1/0)"), "no value"),
        (in_program("x = nowhere"), "nowhere has no value"),
        (in_program("launch()"), "no function launch"),
        (in_program("import os"), "no statement"),
        (in_program('__import__("os")'), "no function __import__"),
        (in_program("x = [].__class__"), "no expression"),
        (in_program("x = (lambda: 1)()"), "no statement"),
        (in_program("while True:", "x = 1", "end"), "endless"),
        (in_program("while True:", "set_digital_out(0, True)", "end"), "endless"),
        (in_program("while True:", "x = get_inverse_kin(p[-0.5,0,0.3,0,3.1,0])", "end"), "endless"),
        (in_program("x = 2", "while True:", "x = x*x", "end"), "too large"),
        (in_program('x = "a"', "while True:", "x = str_cat(x, x)", "end"), "too long"),
        (in_program("def f(x):", "return f(x)", "end", "f(1)"), "without end"),
        (in_program("x = [1]", "x = [x, x]", "x = [x, x]"), "too deep"),
        ("x = " + "(" * 5000, "no statement"),
        ("x = " + "-" * 50_000 + "1", "no program"),
        ("x = " + "1+" * 50_000 + "1", "no program"),
        ("x = a" + "[0]" * 50_000, "no program"),
        ("if True:\n" * 5000, "too deep"),
        ("x = " + "9" * 5000, "no statement"),
        ("movej([0,0,0,0,0,0])\n" * 300_000, "too long"),
    ],
)
def test_what_is_no_program_is_told_in_time(arm, text, reason):
    begin = time.perf_counter()
    with pytest.raises(ScriptError, match=reason):
        for _ in islice(run_script(text, HOME, arm, lambda name, arguments: None), 300_000):
            pass
    assert time.perf_counter() - begin < 20.0


def test_the_fault_names_its_line(told):
    with pytest.raises(ScriptError, match="line 3") as fault:
        told(in_program("sleep(1)", "sleep(-1)"))
    assert fault.value.line == 3


@settings(max_examples=100)
@given(data=st.data())
def test_a_spoilt_program_fails_or_runs_and_does_nothing_else(spoilt, arm, data):
    text = data.draw(spoilt(WELD.encode())).decode("utf-8", "surrogateescape")
    with suppress(ScriptError):
        list(islice(run_script(text, HOME, arm, lambda name, arguments: None), 100))
