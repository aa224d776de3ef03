"""What deploy says of a program and of a run: counts like those of correct, and what was left uncorrected."""

import numpy as np
import pytest
from command import is_refused
from truepath.controller import controller_of
from truepath.deploying.follow import Followed
from truepath.deploying.left_uncorrected import uncorrected_remarks
from truepath.deploying.outcome import Outcome
from truepath.deploying.printed import counted, print_outcome
from truepath.deploying.rehearsal import rehearse
from truepath.deploying.sent_program import read_program
from truepath.rewriting.rewrite import rewrite_program

HOME = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0]
AT_HOME, NO_TOOL = np.array(HOME), [0.0] * 6
JOINTS = "[0.05, -1.57, 1.57, -1.57, -1.57, 0]"
TOOL = "set_tcp(p[0.08, 0, 0.16, 0, 0, 0])"
SEEN = f"def seen():\n  {TOOL}\n  movej({HOME})\n  movej({JOINTS})\n  movel(get_target_tcp_pose())\nend\n"
ROUNDED = f"def rounded():\n  movej({HOME})\n  movej({JOINTS}, r=0.002)\n  movej({HOME})\nend\n"


@pytest.fixture(scope="module")
def believed(calibration):
    return controller_of(calibration.model.robot)


def left(file, calibration, believed):
    return uncorrected_remarks(read_program(file), calibration.model.robot, believed, None, None)


def test_targets_are_counted_as_correct_counts_them(weld, calibration, believed):
    before = weld.parent / "weld.script"
    assert counted(rehearse(weld.read_text(), believed, AT_HOME, NO_TOOL)) == "6 targets (5 motions, 1 via point)"
    assert rewrite_program(before, calibration).summary()["targets"] == 6


def test_one_target_is_one_target(believed):
    assert counted(rehearse(f"movej({JOINTS})\n", believed, AT_HOME, NO_TOOL)) == "1 target"


def test_what_only_a_run_can_tell_is_said_to_be_uncorrected(corrected, calibration, believed):
    said = left(corrected(SEEN, name="seen.script"), calibration, believed)
    assert said == ["1 of 3 targets is not corrected, and the tool may be off there: line 6"]  # one more for the stamp


def test_of_a_program_that_is_all_corrected_nothing_is_said(weld, calibration, believed):
    assert left(weld, calibration, believed) == []


def test_a_robot_that_is_ready_for_part_of_it_is_told_so(truepath, controller, corrected, calibration_file):
    seen = corrected(SEEN, name="seen.script")
    dry = truepath("deploy", seen, "--robot-host", controller.address, "-c", calibration_file, "--dry-run")
    assert dry.code == 0, dry.err
    assert "1 of 3 targets is not corrected" in dry.out


def test_the_file_is_looked_at_before_anybody_is_asked(truepath, calibration_file, tmp_path, monkeypatch):
    (tmp_path / "path.csv").write_text("q1_rad\n")
    monkeypatch.setattr("sys.stdin", open("/dev/null"))  # noqa: SIM115
    arguments = ("--robot-host", "127.0.3.29", "-c", calibration_file)
    assert is_refused(truepath("deploy", tmp_path / "path.csv", *arguments), "only a script")


def test_blends_are_in_brackets_and_not_in_the_summary(believed, capsys):
    rehearsal = rehearse(ROUNDED, believed, AT_HOME, NO_TOOL)
    followed = Followed("completed", completed=True, duration_s=3.0)
    print_outcome(
        Outcome(rehearsal, followed, rehearsal.q_rad, np.zeros(3), np.array([0.003, 2.003, 0.021]), np.ones(3), 3)
    )
    said = capsys.readouterr().out
    assert "completed; 3 of 3 motions made in 3.0 s" in said
    assert "tool 0.012 mm mean, 0.021 mm max" in said
    assert "not counted there: 1 blend, which is to be passed by (in brackets)" in said
    assert "(2.003)" in said
    assert "(0.003)" not in said
