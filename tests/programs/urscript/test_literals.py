"""Functions that are called with one target after the other: the targets are where they are written."""

import numpy as np
import pytest
from scripts import new_targets, read
from truepath.programs.motions import Kind

A, B, C = (f"p[0.3, {y}, 0.4, 0, 3, 0]" for y in (-0.1, 0.1, 0.2))
WELD = "def weld(target, v=0.1):\n  movel(target, a=1, v=v)\nend\n"  # three lines
HOME = "movej([0, -1, 1, -1, -1, 0])\n"


def lines(text):
    parsed = read(text)
    return parsed.motions.line.tolist(), [each.line for each in parsed.unresolved]


def test_a_thousand_calls_are_a_thousand_targets_one_after_the_other():
    calls = "".join(f"weld(p[0.3, 0.0{k:03d}, 0.4, 0, 3, 0])\n" for k in range(1000))
    parsed = read(WELD + HOME + calls)
    motions = parsed.motions
    assert parsed.unresolved == ()
    assert motions.line.tolist() == list(range(4, 1005))
    np.testing.assert_allclose(motions.X_CT[1:, 1, 3], np.arange(1000) / 1e4, atol=1e-12)
    assert motions.previous.tolist() == [-1, *range(1000)]
    assert set(motions.kind[1:].tolist()) == {Kind.LINEAR}
    assert set(motions.speed[1:].tolist()) == {0.1}


def test_the_literal_is_rewritten_and_the_function_stays():
    text = f"{WELD}{HOME}P = {A}  # first\nweld(P)\nweld({B}, 0.3)\n"
    parsed = read(text)
    new = new_targets(parsed.motions)
    written = parsed.rewritten(new, [], "").decode().splitlines()
    numbers = [", ".join(f"{number:.9f}" for number in row) for row in new.values]
    assert written[:3] == WELD.splitlines()
    assert written[3:] == [
        f"movej([{numbers[0]}])",
        f"P = p[{numbers[1]}]  # first",
        "weld(P)",
        f"weld(p[{numbers[2]}], 0.3)",
    ]
    assert np.isnan(parsed.motions.speed[0])
    assert parsed.motions.speed[1:].tolist() == [0.1, 0.3]
    assert [parsed.can_be_added_before(at) for at in range(3)] == [True, False, False]
    assert parsed.statement(2) == f"weld({B}, 0.3)"


@pytest.mark.parametrize(
    "use",
    [
        "x = P[2]",
        "P[2] = 0.1",
        "movel(pose_trans(P, P))",
        "if P == Q:\nsync()\nend",
        "textmsg(P)",
        "l = [P, P]\nmovel(l[n])",
        "movej(P)",
        "set_tcp(P)",
        "movej(get_inverse_kin(P, qnear=[0,0,0,0,0,0]))",
        "movec(P, Q)",
        "if get_digital_in(1):\nP = Q\nend\nmovel(P)",
        "def other(t):\nmovel(t)\nx = t[0]\nend\nother(P)",
        "shared = P",
    ],
)
def test_a_literal_that_serves_for_something_else_is_left_alone(use):
    thread = "thread watch():\nshared = 1\nend\nrun watch()\nmovel(shared)\n"
    text = f"{WELD}Q = {C}\nP = {A}\nweld(P)\nweld({B})\n{use}\n{thread if 'shared' in use else ''}"
    found, left = lines(text)
    assert 2 in left
    assert not {5, 7} & set(found)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (f"{WELD}P = {A}\nif get_digital_in(1):\nP = {C}\nend\nweld(P)\nweld({B})\n", []),
        (f"{WELD}while True:\nP = {A}\nweld(P)\nP = {C}\nweld(P)\nend\n", [5, 7]),
        (f"{WELD}P = {A}\nweld(P)\nweld({B})\nmovel(P, v=0.2)\n", [4, 6]),
        (f"{WELD}def twice(t):\nweld(t)\nweld(t, 0.3)\nend\ntwice({A})\ntwice({B})\n", [8, 9]),
        (f"{WELD}def pick():\nif get_digital_in(1):\nreturn {A}\nend\nreturn {B}\nend\nweld({C})\nweld(pick())\n", []),
        (f"{WELD}def here():\nreturn {A}\nend\nweld(here())\nweld({B})\n", [5, 8]),
        (f"{WELD}weld({A})\nweld({A})\n", [2]),
        (f"{WELD}x = 0.1\nwhile get_digital_in(1):\nweld(p[x, 0, 0, 0, 0, 0])\nx = x + 0.1\nend\nweld({B})\n", []),
        (f"def go(t):\nset_tcp(t)\nend\n{WELD}weld({A})\nweld({B})\ngo({C})\n", [7, 8]),
        (f"def weld(t={A}):\nmovel(t)\nend\nweld()\nweld({B})\n", [1, 5]),
        ("def go(q):\nmovej(q)\nend\ngo([0, -1, 1, -1, -1, 0])\ngo([0, -1, 1, -1, -1, 1])\n", [4, 5]),
    ],
)
def test_where_the_targets_are(text, found):
    assert lines(text)[0] == found


def test_every_literal_has_the_tool_with_which_it_is_reached():
    parsed = read(f"{WELD}set_tcp({A})\nweld({A})\nset_tcp({B})\nweld({B})\n")
    np.testing.assert_allclose(parsed.motions.X_0T[:, 1, 3], [-0.1, 0.1])


def test_a_literal_that_is_reached_with_two_tools_is_left_alone():
    text = f"{WELD}P = {A}\nset_tcp({A})\nweld(P)\nset_tcp({B})\nweld(P)\nweld({C})\n"
    assert lines(text) == ([], [2])
