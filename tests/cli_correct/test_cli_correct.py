"""``truepath correct`` on URScript: what it prints and writes of a program that it can correct."""

import json
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truepath import plants
from truepath.calibration import load_calibration
from truepath.rewriting.rewrite import rewrite_program
from urscript_poses import HOME, TOOL, targets


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


def test_a_tool_that_the_program_does_not_set_can_be_stated(correct, weld, output, poses):
    correct(weld, "--path-tolerance-mm", "10")
    own = targets(output.read_text())
    correct(
        weld.replace("  set_tcp(p[0, 0, 0.12, 0, 0, 0])\n", ""), "--tcp", "0,0,120,0,0,0", "--path-tolerance-mm", "10"
    )
    stated = targets(output.read_text())
    assert list(stated.values()) == list(own.values())


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


def test_where_collisions_were_looked_for_is_said(correct, weld):
    assert "looked for collisions in ur5_cell" in correct(weld).out
    assert "looked for collisions in no cell (--cell)" in correct(weld, "--cell", "none").out


# Findings that do not stop it


def test_an_old_calibration_is_a_warning(weld, calibration, tmp_path):
    program = tmp_path / "weld.script"
    program.write_text(weld)
    in_two_years = datetime.now(timezone.utc).date() + timedelta(days=730)
    found = rewrite_program(program, load_calibration(calibration), today=in_two_years).findings
    assert [(each.guard, each.level) for each in found] == [("calibration-age", "warning")]


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
