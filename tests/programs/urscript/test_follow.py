"""Programs that go in circles, grow without end or are deeper than any person writes: told within seconds."""

import time

import pytest
from scripts import read
from truepath.errors import InputError

POSE = "p[0.1, 0.2, 0.3, 0, 0, 0]"
LONGEST_S = 5.0


def doubling(depth, last):
    first = f"def f0():\n{last}\nend\n"
    return first + "".join(f"def f{k}():\nf{k - 1}()\nf{k - 1}()\nend\n" for k in range(1, depth)) + f"f{depth - 1}()\n"


def loops(depth):
    inner = "".join(f"i{k} = 0\nwhile get_digital_in({k}):\ni{k} = i{k} + 1\n" for k in range(depth))
    return inner + "movel(p[i3, 0, 0, 0, 0, 0])\n" + "end\n" * depth


REFUSED = {
    "calls that double": (doubling(30, "sync()"), "too long to be followed"),
    "calls that double and compute": (doubling(30, f"movel(pose_trans({POSE}, {POSE}))"), "too long to be followed"),
    "loops in loops": (loops(50), "too long to be followed"),
    "recursion": ("def f():\ng()\nend\ndef g():\nf()\nend\nf()\n", "too deep"),
    "a sum of thousands": ("x = " + "+".join(["1"] * 9000) + "\n", "too deep"),
    "signs": ("x = " + "-" * 5000 + "1\n", "too deep"),
    "brackets": ("x = " + "(" * 70 + "1" + ")" * 70 + "\n", "too deep"),
    "blocks": ("if a:\n" * 70 + "end\n" * 70, "too deep"),
    "a line without end": ("x = " + "1" * 200_000 + "\n", "too long"),
    "brackets that nobody closes": ("x = [\n" + "1,\n" * 3000, "never closed"),
    "never the same": ("".join(f"x = [{'a, ' * (800 + k)}a]\n" for k in range(300)), "too many different"),
}
READ = {
    "a variable for ever": "x = 0\nwhile True:\nx = x + 1\nmovel(p[x, 0, 0, 0, 0, 0])\nend\n",
    "huge numbers": f"x = {'9' * 400}\ny = x * x\nz = pow(x, x)\nmovel(p[x, y, z, 0, 0, 0])\n",
    "lists of lists": "x = [1]\nz = [1]\n" + "x = [x, x]\nz = [z, z]\n" * 60 + "if x == z:\nsync()\nend\nmovel(x)\n",
    "a list that grows": "x = [1]\nwhile get_digital_in(1):\nx[0] = x\nend\nmovel(x)\n",
    "a long chain of conditions": "if a:\nsync()\n" + "elif b:\nsync()\n" * 3000 + "end\nmovel(x)\n",
    "joined lines": "x = [" + "\n1," * 1900 + "1]\nmovel(x)\n",
}


def timed(text):
    begun = time.process_time()
    try:
        return read(text), None
    except InputError as error:
        return None, str(error)
    finally:
        assert time.process_time() - begun < LONGEST_S


@pytest.mark.parametrize(("text", "word"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_followed_is_refused_in_time(text, word):
    _, said = timed(text)
    assert word in said
    assert said.startswith("p.script")


@pytest.mark.parametrize("text", READ.values(), ids=READ)
def test_what_only_looks_dangerous_is_read_and_its_target_is_not_known(text):
    parsed, said = timed(text)
    assert said is None
    assert len(parsed.motions) == 0
    assert len(parsed.unresolved) == 1


def test_many_conditions_with_many_variables_end_in_time():
    variables = "".join(f"a{k} = {k}\n" for k in range(3000))
    changes = "".join(f"if get_digital_in(1):\na{k} = 0\nend\n" for k in range(3000))
    parsed, _ = timed(variables + changes + "movel(p[a1, 0, 0, 0, 0, 0])\n")
    assert parsed is None or [each.line for each in parsed.unresolved] == [12001]


@pytest.mark.parametrize("around", ["def p():\n{}end\n", "def p():\nwhile True:\n{}end\nend\n"])
def test_a_long_program_is_no_reason_to_refuse_it(around):
    moves = "".join(f"global P{k} = p[0.{k:05d}, 0, 0, 0, 0, 0]\nmovel(P{k}, a=1, v=0.1)\n" for k in range(5000))
    assert len(read(around.format(moves)).motions) == 5000
