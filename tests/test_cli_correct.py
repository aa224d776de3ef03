"""``truepath correct`` on URScript: what it prints, what it writes, how it exits."""

import json
from dataclasses import replace
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest
from command import is_refused, run
from drake_arm import DrakeArm
from scipy.spatial.transform import Rotation
from truepath import plants
from truepath.calibration import load_calibration
from truepath.learn import learn
from truepath.rewriting.rewrite import rewrite_program
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure

HOME = [0.0, -1.6, 1.7, -1.65, -1.55, 0.1]
TOOL = np.eye(4)
TOOL[2, 3] = 0.12
SHAPE = "p[%.6f, %.6f, %.6f, %.6f, %.6f, %.6f]"


def written(X):
    """A tool pose ``(4, 4)`` as URScript has it."""
    return SHAPE % (*X[:3, 3], *Rotation.from_matrix(X[:3, :3]).as_rotvec())


@pytest.fixture(scope="module")
def arm():
    return DrakeArm("ur5")


@pytest.fixture(scope="module")
def poses(arm):
    """Three tool poses, 200 mm apart, with a tool of 120 mm."""
    first = (arm.flange_poses(np.array([HOME])) @ TOOL)[0]
    poses = []
    for step in ([0, 0, 0], [0, 0.2, 0], [0.1, 0.2, -0.15]):
        X = first.copy()
        X[:3, 3] += step
        poses.append(written(X))
    return poses


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    real = RealRobot("ur5_cell", seed=4)
    data = measure(real, free_poses(real, 100, np.random.default_rng(0)), Campaign())
    stated = replace(data, X_MB_nominal=real.robot.X_WB, X_FE_nominal=real.robot.X_FR)
    path = tmp_path_factory.mktemp("calibration") / "ur5.json"
    learn(real.robot, stated, source="ur5_cell").calibration.save(path)
    return path


@pytest.fixture
def correct(monkeypatch, capsys, calibration, tmp_path):
    """Runs the command on a program text; its output is ``out.script``."""

    def correct(text, *options, name="weld.script", output=True):
        program = tmp_path / name
        program.write_bytes(text if isinstance(text, bytes) else text.encode())
        target = ("-o", tmp_path / "out.script") if output else ()
        return run(monkeypatch, capsys, "correct", program, "-c", calibration, *target, *options)

    return correct


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.script"


@pytest.fixture
def weld(poses):
    return f"""def weld():  # made for robot: UR5
  set_tcp(p[0, 0, 0.12, 0, 0, 0])
  movej({HOME}, a=1.4, v=1.05)  # home
  movel({poses[1]}, a=1.2, v=0.1, r=0.002)
  set_digital_out(0, True)
  movel({poses[2]}, a=1.2, v=0.1)
end
"""


def targets(text):
    """Numbers of the moves of a program, by line."""
    return {
        number: [float(each) for each in line.split("[", 1)[1].split("]")[0].split(",")]
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip().startswith("move")
    }


def test_the_program_is_the_same_but_for_its_targets_and_a_first_line(correct, weld, output):
    outcome = correct(weld, "--path-tolerance-mm", "10")
    assert outcome.code == 0
    assert "3 of 3 targets corrected" in outcome.out
    header, *lines = output.read_text().splitlines()
    assert header.startswith("# truepath-corrected version=")
    for old, new in zip(weld.splitlines(), lines, strict=True):
        if "move" in old:
            assert (old.split("[")[0], old.split("]")[-1]) == (new.split("[")[0], new.split("]")[-1])
            assert old != new
        else:
            assert old == new


def test_corrected_poses_are_those_that_the_controller_turns_into_the_corrected_joints(correct, weld, output, arm):
    """The nominal controller goes to a corrected pose; the calibrated robot is then where the program means it."""
    correct(weld, "--as", "joints", "--path-tolerance-mm", "10")
    joints = targets(output.read_text())
    correct(weld, "--path-tolerance-mm", "10")
    poses = targets(output.read_text())
    for line in (5, 7):
        X = (arm.flange_poses(np.array([joints[line]])) @ TOOL)[0]
        assert X[:3, 3] == pytest.approx(poses[line][:3], abs=1e-8)
        assert Rotation.from_rotvec(poses[line][3:]).as_matrix() == pytest.approx(X[:3, :3], abs=1e-8)


def test_moves_by_joints_can_be_written_as_poses_with_their_posture(correct, weld, output):
    correct(weld, "--as", "poses")
    assert "movej(get_inverse_kin(p[" in output.read_text()
    assert "qnear=[" in output.read_text()


def test_long_lines_get_targets_on_the_way(correct, weld, output):
    without = correct(weld, "--path-tolerance-mm", "10", "--json").json()["path"]
    assert without["added"] == 0
    tolerance = without["off_before_mm"] / 2
    path = correct(weld, f"--path-tolerance-mm={tolerance}", "--json").json()["path"]
    assert path["added"] >= 1
    assert path["off_after_mm"] <= tolerance < path["off_before_mm"]
    assert {each["line"] for each in path["lines"]} <= {4, 6}
    assert output.read_text().count("movel(") == 2 + path["added"]


def test_a_dry_run_writes_nothing(correct, weld, output):
    outcome = correct(weld, "--dry-run")
    assert outcome.code == 0
    assert "nothing is written" in outcome.out
    assert "predicted error of the tool" in outcome.out
    assert not output.exists()
    assert correct(weld, "--dry-run", output=False).code == 0


def test_without_a_place_to_write_to_it_asks_for_one(correct, weld):
    assert is_refused(correct(weld, output=False), "nowhere to write to", "--output")


def test_its_own_work_is_not_corrected_twice(correct, weld, output):
    assert correct(weld).code == 0
    again = output.read_bytes()
    output.unlink()
    assert is_refused(correct(again), "weld.script, line 1", "has corrected this program already")
    assert not output.exists()


UNRESOLVED = """  movel(get_actual_tcp_pose(), a=1, v=0.1)
"""


def test_what_only_a_run_can_tell_stays_and_is_told(correct, weld, output):
    text = weld.replace("  set_digital_out(0, True)\n", UNRESOLVED)
    outcome = correct(text)
    assert outcome.code == 1
    assert "line 5: movel(get_actual_tcp_pose(), a=1, v=0.1)" in outcome.out
    assert UNRESOLVED in output.read_text()
    assert correct(text, "--allow-partial").code == 0
    content = correct(text, "--json").json()
    assert [each["line"] for each in content["unresolved"]] == [5]
    assert (content["targets"], content["corrected"]) == (4, 3)


def test_a_program_of_poses_only_needs_a_posture_to_start_from(correct, poses):
    text = f"def p():\n  set_tcp(p[0,0,0.12,0,0,0])\n  movel({poses[0]}, v=0.1)\nend\n"
    outcome = correct(text)
    assert outcome.code == 1
    assert "--start-deg" in outcome.out
    start = ",".join(f"{np.degrees(each):.1f}" for each in HOME)
    assert correct(text, f"--start-deg={start}").code == 0


def test_a_tool_that_the_program_does_not_set_can_be_stated(correct, weld, output, poses):
    correct(weld, "--path-tolerance-mm", "10")
    own = targets(output.read_text())
    correct(
        weld.replace("  set_tcp(p[0, 0, 0.12, 0, 0, 0])\n", ""), "--tcp", "0,0,120,0,0,0", "--path-tolerance-mm", "10"
    )
    stated = targets(output.read_text())
    assert list(stated.values()) == list(own.values())


def test_a_program_for_another_robot_is_refused(correct, weld, output):
    assert is_refused(correct(weld.replace("UR5", "UR10")), "the program is for 'UR10'")
    assert not output.exists()


def test_an_old_calibration_is_a_warning(weld, calibration, tmp_path):
    program = tmp_path / "weld.script"
    program.write_text(weld)
    in_two_years = datetime.now(timezone.utc).date() + timedelta(days=730)
    found = rewrite_program(program, load_calibration(calibration), today=in_two_years).findings
    assert [(each.guard, each.level) for each in found] == [("calibration-age", "warning")]


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
        (b"def p():\n\x00\nend\n", ("line 2", "a zero byte")),
        ("def p():\n  movej([9, 0, 0, 0, 0, 0])\nend\n", ("line 2", "passes a joint limit")),
        ("def p():\n  movej([0,-1.6,1.7,-1.6,-1.5,0])\n  movel(p[9,0,0,0,0,0])\nend\n", ("line 3", "out of reach")),
        ("def p():\n  movel(p[1e9,0,0,0,0,0])\nend\n", ("line 2", "far from any robot")),
    ],
)
def test_bad_programs_are_refused_with_their_line(correct, output, text, words):
    assert is_refused(correct(text), "weld.script", *words)
    assert not output.exists()


def test_an_ending_that_nobody_knows(correct, weld):
    assert is_refused(correct(weld, name="weld.urp"), "unknown kind of program", ".script")


def test_a_missing_program(monkeypatch, capsys, calibration, tmp_path):
    outcome = run(
        monkeypatch, capsys, "correct", tmp_path / "no.script", "-c", calibration, "-o", tmp_path / "o.script"
    )
    assert is_refused(outcome, "no.script", "cannot be read")


def test_nothing_to_correct_is_said(correct, output):
    outcome = correct("def p():\n  sync()\nend\n")
    assert outcome.code == 0
    assert "no target that can be corrected" in outcome.out
    assert output.read_text() == "def p():\n  sync()\nend\n"


def test_the_json_says_what_was_done(correct, weld, output):
    content = correct(weld, "--json").json()
    assert content["schema"] == "truepath.correction/1"
    assert content["output"] == str(output)
    assert (content["targets"], content["corrected"], content["changed"], content["waypoints"]) == (3, 3, 3, 3)
    assert content["predicted_error_after_mm"]["max"] < 1e-6 < 0.1 < content["predicted_error_before_mm"]["mean"]
    assert content["cell"] == "ur5_cell"
    assert json.dumps(content, allow_nan=False)


TWICE = """def pick():
  movel(p[0.093022, -0.359454, 0.019153, -0.171982, 1.690211, 1.801271])
end
def prog():
  set_tcp(p[0, 0, 0, 0, 0, 0])
  movej([1.470356, -0.960435, 1.998879, -0.874187, -1.332254, -0.584063])
  pick()
  movej({second})
  pick()
end
prog()
"""
SAME_POSTURE = "[1.470356, -0.960435, 1.998879, -0.874187, -1.332254, -0.584063]"
OTHER_POSTURE = "[-1.170948, 1.797779, 1.997534, -0.868668, -2.301174, 2.452038]"


def test_a_pose_that_is_reached_in_two_postures_is_not_corrected_for_one_of_them(correct):
    """One correction cannot be right for both: in the other posture the real robot errs otherwise."""
    same = correct(TWICE.format(second=SAME_POSTURE), "--cell", "none", "--json").json()
    other = correct(TWICE.format(second=OTHER_POSTURE), "--cell", "none", "--json").json()
    assert same["unresolved"] == []
    assert [each["line"] for each in other["unresolved"]] == [2]


def test_what_follows_a_posture_that_cannot_be_told_cannot_be_told_either(correct, poses):
    text = f"def p():\n  movel({poses[0]})\n  movel({poses[1]})\n  movej({HOME})\n  movel({poses[1]})\nend\n"
    content = correct(text, "--tcp", "0,0,120,0,0,0", "--json").json()
    assert [each["line"] for each in content["unresolved"]] == [2, 3]


TIE = """def p():
  set_tcp(p[0, 0, 0, 0, 0, 0])
  movej([1.0, -0.83, 0.12, -0.74, -1.57, 0.5])
  movej(p[-0.487173, -0.109216, 0.431784, 2.220645, 2.220645, 0])
  movel(p[-0.487173, -0.059216, 0.431784, 2.220645, 2.220645, 0])
  movej([0, -1.6, 1.7, -1.65, -1.55, 0.1])
end
"""


def test_what_follows_a_tie_of_two_postures_is_not_corrected_for_a_guess(correct):
    content = correct(TIE, "--cell", "none", "--json").json()
    assert [each["line"] for each in content["unresolved"]] == [4, 5]
    assert content["corrected"] == 2


def test_poses_without_a_tool_are_a_warning(correct, poses):
    text = f"def p():\n  movej({HOME})\n  movel({poses[0]})\nend\n"
    guards = [each["guard"] for each in correct(text, "--cell", "none", "--json").json()["findings"]]
    assert "tool" in guards
    guards = [
        each["guard"] for each in correct(text, "--cell", "none", "--tcp", "0,0,120,0,0,0", "--json").json()["findings"]
    ]
    assert "tool" not in guards


def test_a_path_of_poses_starts_from_the_stated_posture(correct, tmp_path):
    text = (plants.models_dir() / "ur5" / "pose_path.csv").read_text()
    options = ("--cell", "none", "--json", "--as", "poses")
    assert [each["guard"] for each in correct(text, *options, name="a.csv").json()["findings"]] == ["posture"]
    assert correct(text, *options, "--start-deg", "0,-90,90,-90,-90,0", name="a.csv").json()["findings"] == []


def test_a_path_of_joints_has_no_place_for_poses(correct):
    text = (plants.models_dir() / "ur5" / "weld_path.csv").read_text()
    assert is_refused(correct(text, "--as", "poses", name="a.csv"), "no columns for poses")


def test_where_collisions_were_looked_for_is_said(correct, weld):
    assert "looked for collisions in ur5_cell" in correct(weld).out
    assert "looked for collisions in no cell (--cell)" in correct(weld, "--cell", "none").out
