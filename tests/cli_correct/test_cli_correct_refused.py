"""``truepath correct`` refuses what makes no sense, with one clear message, and writes nothing."""

import pytest
from command import is_refused, run
from truepath import plants


def test_without_a_place_to_write_to_it_asks_for_one(correct, weld):
    assert is_refused(correct(weld, output=False), "nowhere to write to", "--output")


def test_its_own_work_is_not_corrected_twice(correct, weld, output):
    assert correct(weld).code == 0
    again = output.read_bytes()
    output.unlink()
    assert is_refused(correct(again), "weld.script, line 1", "has corrected this program already")
    assert not output.exists()


def test_a_program_for_another_robot_is_refused(correct, weld, output):
    assert is_refused(correct(weld.replace("UR5", "UR10")), "the program is for 'UR10'")
    assert not output.exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--as", "quaternions"), ("unknown form 'quaternions'", "joints or poses")),
        (("--path-tolerance-mm", "nan"), ("the path tolerance is no length",)),
        (("--start-deg", "1,2,3"), ("cannot read --start-deg", "6 angles in degrees")),
        (("--start-deg", "1,2,3,4,5,inf"), ("cannot read --start-deg",)),
        (("--tcp", "a,b"), ("cannot read --tcp", "x,y,z in mm")),
        (("--cell", "nowhere.dmd.yaml"), ("nowhere.dmd.yaml",)),
        (("--cell", "ur10_cell"), ("arm",)),
        (("--controller-kinematics", "missing.conf"), ("missing.conf",)),
        (("--max-correction-mm", "0.01"), ("weld.script, line 3", "larger than allowed")),
    ],
)
def test_options_that_make_no_sense(correct, weld, output, options, words):
    assert is_refused(correct(weld, *options), *words)
    assert not output.exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def p():\n  movel(p[1, 2\nend\n", ("line 2", "a bracket is opened and never closed")),
        ("def p():\n  movel(p[0.1,,0.2])\nend\n", ("line 2, column '15'", "this is not understood")),
        ("def p():\n  sync()\n", ("line 1", "'def' is not closed")),
        ("sync()\nend\n", ("line 2", "an 'end' too many")),
        ("", ("weld.script: the program is empty",)),
        ("# no more than a comment\n\n", ("weld.script: the program is empty", "a statement at least")),
        (b"def p():\n\x00\nend\n", ("line 2", "a zero byte")),
        ("def p():\n  movej([9, 0, 0, 0, 0, 0])\nend\n", ("line 2", "passes a joint limit")),
        ("def p():\n  movej([0,-1.6,1.7,-1.6,-1.5,0])\n  movel(p[9,0,0,0,0,0])\nend\n", ("line 3", "out of reach")),
        (
            "def p():\n  movej([0,-1.6,1.7,-1.6,-1.5,0])\n" + "  movel(p[1.2,0,0.3,0,0,0])\n" * 4 + "end\n",
            ("line 3", "out of reach", "so are most targets: is it a program for another robot?"),
        ),
        ("def p():\n  movel(p[1e9,0,0,0,0,0])\nend\n", ("line 2", "far from any robot")),
    ],
)
def test_bad_programs_are_refused_with_their_line(correct, output, text, words):
    assert is_refused(correct(text), "weld.script", *words)
    assert not output.exists()


def test_an_ending_that_nobody_knows(correct, weld):
    assert is_refused(correct(weld, name="weld.urp"), "unknown kind of program", ".script")


def test_one_target_out_of_reach_is_not_taken_for_another_robot(correct):
    near = "".join(f"  movel(p[-0.4,{y},0.3,0,3.1,0])\n" for y in (0.10, 0.12, 0.14))
    text = f"def p():\n  movej([0,-1.6,1.7,-1.6,-1.5,0])\n  movel(p[1.2,0,0.3,0,0,0])\n{near}end\n"
    outcome = correct(text)
    assert is_refused(outcome, "line 3", "out of reach")
    assert "another robot" not in outcome.err


@pytest.mark.parametrize(
    ("name", "output", "expected"),
    [("weld.script", "out.CSV", "a name ending in .script"), ("path.csv", "out.urscript", "a name ending in .csv")],
)
def test_an_output_named_as_another_format(monkeypatch, capsys, calibration, tmp_path, name, output, expected):
    (tmp_path / name).write_text("sync()\n")
    outcome = run(monkeypatch, capsys, "correct", tmp_path / name, "-c", calibration, "-o", tmp_path / output)
    assert is_refused(outcome, output, "named as a program of another format", expected)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_missing_program(monkeypatch, capsys, calibration, tmp_path):
    outcome = run(
        monkeypatch, capsys, "correct", tmp_path / "no.script", "-c", calibration, "-o", tmp_path / "o.script"
    )
    assert is_refused(outcome, "no.script", "cannot be read")


def test_a_path_of_joints_has_no_place_for_poses(correct):
    text = (plants.models_dir() / "ur5" / "weld_path.csv").read_text()
    assert is_refused(correct(text, "--as", "poses", name="a.csv"), "no columns for poses")
