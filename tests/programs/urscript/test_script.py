"""What is read of a program, against truth that was written with it; and that nothing else becomes of it."""

import numpy as np
import pytest
from generate import program
from scripts import SCRIPTS, differs_elsewhere, expected_of, faults, new_targets, nothing_new, read
from truepath.errors import InputError

SOME, MANY = 250, 1000
CALL = "movel(p[0.1, 0.2, 0.3, 0, 0, 0], a=1, v=0.1)"


def truth_of(made):
    return {"targets": made.targets, "unresolved": [{"line": n} for n in made.unresolved_lines], "optional": []}


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_the_corpus_is_read_as_it_was_meant(script):
    assert faults(read(script.read_bytes()), expected_of(script)) == []


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_the_corpus_stays_as_it_is_to_the_byte(script):
    assert read(script.read_bytes()).rewritten(nothing_new(), [], "") == script.read_bytes()


@pytest.mark.parametrize("seeds", [range(SOME), pytest.param(range(SOME, MANY), marks=pytest.mark.slow)], ids=len)
def test_generated_programs_are_read_as_they_were_made_and_stay_as_they_are(seeds):
    for seed in seeds:
        made = program(seed, statements=2 + seed % 12)
        parsed = read(made.data)
        # Where nothing at the top moves or calls, the generator sees nothing done; truepath takes the definitions.
        if made.targets or made.unresolved_lines:
            assert faults(parsed, truth_of(made)) == [], seed
        assert parsed.rewritten(nothing_new(), [], "") == made.data, seed


def written_and_read_again(data, seed):
    before = read(data)
    new = new_targets(before.motions, seed)
    content = before.rewritten(new, [], "")
    after = read(content)
    if len(after.motions) > len(before.motions):  # a literal that was computed with serves for nothing else any more
        new_lines = set(after.motions.line.tolist()) - set(before.motions.line.tolist())
        kept = [at for at, line in enumerate(after.motions.line) if line not in new_lines]
        np.testing.assert_array_equal(after.motions.q_rad[kept][~new.is_pose], new.values[~new.is_pose])
        return content, new.values
    assert [vars(each) for each in after.unresolved] == [vars(each) for each in before.unresolved]
    np.testing.assert_array_equal(after.motions.line, before.motions.line)
    np.testing.assert_array_equal(after.motions.is_pose, new.is_pose)
    joints = ~new.is_pose
    np.testing.assert_array_equal(after.motions.q_rad[joints], new.values[joints])
    np.testing.assert_allclose(after.motions.X_CT[new.is_pose][:, :3, 3], new.values[new.is_pose][:, :3], atol=1e-15)
    for name in ("speed", "acceleration", "time_s", "blend_m", "tools", "tool", "previous", "origin"):
        np.testing.assert_array_equal(getattr(after.motions, name), getattr(before.motions, name), name)
    near = after.motions.q_near_rad
    stays = np.all(near == before.motions.q_near_rad, axis=1) | np.isnan(near[:, 0])
    np.testing.assert_array_equal(near[~stays], new.q_near_rad[~stays])
    return content, new.values


ON_ONE_LINE = [script for script in SCRIPTS if expected_of(script)["targets"]]


@pytest.mark.parametrize("script", ON_ONE_LINE, ids=lambda script: script.stem)
def test_new_targets_and_nothing_else_are_written_into_the_corpus(script):
    content, values = written_and_read_again(script.read_bytes(), 1)
    assert not differs_elsewhere(script.read_bytes(), content, values)


def test_new_targets_are_written_into_generated_programs():
    for seed in range(MANY, MANY + 60):
        data = program(seed).data
        written_and_read_again(data, seed)


def test_a_tool_that_was_stated_beforehand_holds_until_the_program_sets_one():
    parsed = read(f"{CALL}\nset_tcp(p[0,0,0.2,0,0,0])\n{CALL}\n", tool=(0, 0, 0.1, 0, 0, 0))
    assert parsed.motions.X_0T[:, 2, 3].tolist() == [0.1, 0.2]
    assert parsed.states_tool


@pytest.mark.parametrize(
    ("data", "line", "word"),
    [
        (b"movej([0,0,0,0,0,0])\n\x00", 2, "zero byte"),
        ("movel(".encode("utf-16"), None, "UTF-8"),
        (b"sync()\nmovel(p[0,0,0,0,0,0]\n", 2, "bracket"),
        (b"sync()\nx = = 1\n", 2, "understood"),
        (b"def f():\nsync()\n", 1, "'def' is not closed"),
        (b"sync()\nend\n", 2, "too many"),
        (b"if a:\nelse:\nelse:\nend\n", 3, "'else' without"),
        (b"movel(p[1e4,0,0,0,0,0])\n", 1, "far from any robot"),
        (b"sync()\nmovej(get_inverse_kin(p[0,0,0,0,0,0], [0,0,0,0,0,9e9]))\n", 2, "far from any robot"),
        (b"1 = 2\n", 1, "nothing can be put there"),
    ],
)
def test_what_is_no_program_is_refused_with_its_line(data, line, word):
    with pytest.raises(InputError) as caught:
        read(data)
    assert caught.value.line == line
    assert word in str(caught.value)
    assert "p.script" in str(caught.value)


@pytest.mark.parametrize("number", ["1e999", "9" * 400, "nan", "0x1F/0"])
def test_a_number_that_is_none_is_never_a_target(number):
    text = f"x = {number}\nmovel(p[x, 0, 0, 0, 0, 0])\nmovej(get_inverse_kin(p[0,0,0,0,0,0], [0,0,0,0,0,x]))\n"
    parsed = read(text)
    assert len(parsed.motions) == 0
    assert [each.line for each in parsed.unresolved] == [2, 3]


def test_hexadecimal_numbers_are_read_beside_decimal_ones():
    parsed = read("movej([1,0,0,0,0,0])\nmovej([0x2,0,0,0,0,0])\nmovej([3,0,0,0,0,0])\n")
    assert parsed.motions.q_rad[:, 0].tolist() == [1.0, 2.0, 3.0]


ARC = "movec(p[-0.4,0.1,0.2,0,3.1,0], p[-0.5,0,0.2,0,3.1,0], a=1, v=0.1{mode})\n"


@pytest.mark.parametrize("mode", ["", ", r=0, mode=0", ", mode=2 - 2"])
def test_an_arc_with_the_orientation_of_its_end_is_resolved(mode):
    assert len(read(ARC.format(mode=mode).encode()).motions) == 2


@pytest.mark.parametrize(("mode", "word"), [("1", "mode is 1"), ("get_mode()", "which is not known")])
def test_an_arc_along_which_the_tool_turns_is_not(mode, word):
    script = read(ARC.format(mode=f", mode={mode}").encode())
    assert len(script.motions) == 0
    assert word in script.unresolved[0].why


@pytest.mark.parametrize(
    ("move", "why"),
    [
        ("movej([0,-1.6,1.7,-1.6,-1.5])", "a list of 5 numbers, and six joints are expected"),
        ("q = [1,2,3,4,5,6,7]\nservoj(q)", "a list of 7 numbers, and six joints are expected"),
        ("x = p[-0.4,0.1,0.2,0,3.1,0]\nservoj(x)", "a pose, and servoj takes six joints"),
        ('movej([0,-1.6,1.7,-1.6,-1.5,"0"])', "neither six joints nor a pose"),
    ],
)
def test_a_target_that_no_robot_takes_is_told_as_what_it_is(move, why):
    (unresolved,) = read(move.encode()).unresolved
    assert unresolved.why.endswith(why)


DRIFT = """def p():
  movej([0,-1.6,1.7,-1.6,-1.5,0])
  {command}
  movel(p[-0.4,0.1,0.2,0,3.1,0], v=0.1)
end
"""


@pytest.mark.parametrize(
    ("command", "previous", "origin"),
    [
        ("sync()", 0, 0),
        ("force_mode(p[0,0,0,0,0,0])", -1, 0),
        ("speedl([0,0,0.1,0,0,0], 1, 1)", -1, 0),
        ("stopj(2)", -1, -1),
    ],
)
def test_what_pushes_the_tool_keeps_the_posture_but_not_the_place(command, previous, origin):
    motions = read(DRIFT.format(command=command).encode()).motions
    assert (motions.previous[1], motions.origin[1]) == (previous, origin)


def test_where_several_motions_lead_to_a_target_all_of_them_are_known():
    text = """def p():
  movel([0,-1.6,1.7,-1.6,-1.5,0])
  while get_digital_in(0):
    movel([0,-1.5,1.7,-1.6,-1.5,0])
    movel([0,-1.4,1.7,-1.6,-1.5,0])
  end
end
"""
    motions = read(text.encode()).motions
    assert motions.previous.tolist() == [-1, -1, 1]
    assert motions.possible.tolist() == [[0, 1], [2, 1]]


def test_definitions_that_nobody_calls_are_the_program_though_something_stands_beside_them():
    script = read(b"set_tcp(p[0,0,0.1,0,0,0])\ndef p():\n  movej([0,-1.6,1.7,-1.6,-1.5,0])\nend\n")
    assert script.motions.line.tolist() == [3]
    assert script.unreached == ()


def test_moves_that_are_never_made_are_told():
    main = "def p():\n  movej([0,-1.6,1.7,-1.6,-1.5,0])\n  return 1\n  movej([0,0,0,0,0,0])\nend\n"
    text = f"{main}def q():\n servoc(p[1,0,0,0,0,0])\nend\np()\n"
    assert read(text.encode()).unreached == (4, 7)


def test_other_moves_than_those_that_are_corrected_are_listed():
    script = read(b"def p():\n  optimovel(p[-0.4,0.1,0.2,0,3.1,0])\nend\n")
    assert [(each.line, each.why) for each in script.unresolved] == [(2, "optimovel() is not corrected")]


@pytest.mark.parametrize(
    "statement",
    [
        "q.pop()",
        "x = q.append(1)",
        "if get_digital_in(0) and change():\n  sync()\n  end",
        "if False and change():\n  sync()\n  end",
        "x = True or change()",
    ],
)
def test_what_may_be_changed_is_not_known(statement):
    text = f"""def p():
  global q = [0,-1.6,1.7,-1.6,-1.5,0]
  def change():
    global q = [0,-1.5,1.7,-1.6,-1.5,0]
    return True
  end
  {statement}
  movej(q)
end
"""
    script = read(text.encode())
    assert len(script.motions) == 0
    assert len(script.unresolved) == 1


def test_a_tool_that_a_thread_sets_is_not_known():
    thread = " thread t():\n  set_tcp(p[0,0,0.2,0,0,0])\n end\n"
    text = f"def p():\n{thread} set_tcp(p[0,0,0.1,0,0,0])\n run t()\n movel(p[-0.4,0.1,0.2,0,3.1,0])\nend\n"
    assert "a thread calls set_tcp()" in read(text.encode()).unresolved[0].why
