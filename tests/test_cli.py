"""The command line from measured poses to a proven calibration: what it prints, what it writes, how it exits."""

import json
import subprocess
import sys

import numpy as np
import pytest
from command import is_refused
from drake_arm import DrakeArm
from truepath import plants
from truepath.calibration import load_calibration
from truepath.programs.toolpath_csv import read_toolpath
from truepath.virtual.real_robot import RealRobot

WELD_PATH = plants.models_dir() / "ur5" / "weld_path.csv"


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """A folder with a finished calibration: measured.csv, fresh.csv, moved.csv (two tracker places) and ur5.json."""
    folder = tmp_path_factory.mktemp("cell")

    # One process for all: importing Drake takes longer than the work.
    script = """
import sys
from truepath.cli import app
for line in sys.stdin.read().splitlines():
    app(line.split(), standalone_mode=False)
"""
    commands = """simulate -o measured.csv --seed 4 --poses 200 --truth truth.json
simulate -o fresh.csv --seed 4 --poses 60 --poses-seed 1
simulate -o moved.csv --seed 4 --poses 60 --poses-seed 2 --tracker
calibrate measured.csv -o ur5.json --robot ur5_cell --measured-in world --probe model"""
    done = subprocess.run(
        [sys.executable, "-c", script], input=commands, cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    moved = (folder / "moved.csv").read_text().splitlines(keepends=True)
    (folder / "moved_few.csv").write_text("".join(moved[:13]))
    (folder / "moved_rest.csv").write_text("".join(moved[:1] + moved[13:]))
    return folder


# calibrate


def test_calibrate_tells_what_it_found_and_where_it_wrote_it(truepath, cell, tmp_path):
    output = tmp_path / "a" / "long" / "folder" / "name, so that the path is longer than a line of eighty" / "c.json"
    output.parent.mkdir(parents=True)
    outcome = truepath("calibrate", cell / "measured.csv", "-o", output, "--robot", "ur5", "--parameters")
    assert outcome.code == 0
    assert "200 poses (3D) of measured.csv" in outcome.out
    assert "held at nominal" in outcome.out
    assert "axis1.pos_x, axis1.pos_y" in outcome.out
    assert f"written to {output}\n" in outcome.out
    assert "axis6.rot_y" in outcome.out
    assert load_calibration(output).robot.name == "ur5"


def test_calibrate_prints_json_for_machines(truepath, cell, tmp_path):
    outcome = truepath("calibrate", cell / "measured.csv", "-o", tmp_path / "c.json", "--robot", "ur5", "--json")
    content = outcome.json()
    assert outcome.code == 0
    assert content["calibration"] == str(tmp_path / "c.json")
    assert content["heldout"]["calibrated"]["position_mm"]["mean"] < 0.04
    assert content["noise"]["position_mm"] == pytest.approx(0.02, rel=0.1)
    assert content["data"]["poses"] == 200
    assert content["robot"]["name"] == "ur5"
    assert len(content["parameters"]) == 36


def test_the_probe_may_be_stated_in_mm_on_the_flange(truepath, cell, tmp_path):
    truepath(
        *("calibrate", cell / "measured.csv", "-o", tmp_path / "c.json", "--robot", "ur5_cell"),
        *("--measured-in", "world", "--probe", "-70,0,31", "--effects", "none"),
    )
    stated, by_model = (load_calibration(path).model for path in (tmp_path / "c.json", cell / "ur5.json"))
    assert stated.tool_is_given
    assert np.allclose(stated.X_FE_nominal, by_model.X_FE_nominal, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--robot", "ur7"], "no robot 'ur7'"),
        (["--robot", "ur5", "--format", "excel"], "unknown format 'excel'"),
        (["--robot", "ur5", "--format", "jacobi2025"], "give --format csv"),
        (["--robot", "ur5", "--measured-in", "moon"], "unknown measurement frame 'moon'"),
        (["--robot", "ur5", "--probe", "1,2"], "cannot read the place of the probe '1,2'"),
        (["--robot", "ur5", "--probe", "nan,0,0"], "cannot read the place of the probe"),
        (["--robot", "ur5", "--probe", "model"], "no frame called 'reflector'"),
        (["--robot", "ur10"], "another robot"),
    ],
)
def test_calibrate_refuses_what_it_is_not_told_well(truepath, cell, tmp_path, options, word):
    outcome = truepath("calibrate", cell / "measured.csv", "-o", tmp_path / "c.json", *options)
    assert is_refused(outcome, word)
    assert list(tmp_path.iterdir()) == []


def test_a_fault_in_the_data_is_told_with_file_line_and_column(truepath, cell, tmp_path):
    lines = (cell / "measured.csv").read_text().splitlines()
    lines[7] = ",".join([*lines[7].split(",")[:8], "oops"])
    bad = tmp_path / "bad.csv"
    bad.write_text("\n".join(lines))
    outcome = truepath("calibrate", bad, "-o", tmp_path / "c.json", "--robot", "ur5")
    assert is_refused(outcome, f"{bad}, line 8, column 'z_mm'", "text where a number belongs", "'oops'")
    assert not (tmp_path / "c.json").exists()


def test_too_few_poses_are_refused_before_anything_is_written(truepath, cell, tmp_path):
    few = tmp_path / "few.csv"
    few.write_text("".join((cell / "measured.csv").read_text().splitlines(keepends=True)[:8]))
    outcome = truepath("calibrate", few, "-o", tmp_path / "c.json", "--robot", "ur5")
    assert is_refused(outcome, "too few poses")
    assert not (tmp_path / "c.json").exists()


def test_calibrate_does_not_overwrite_the_measured_data(truepath, cell, tmp_path):
    data = tmp_path / "measured.csv"
    data.write_bytes((cell / "measured.csv").read_bytes())
    outcome = truepath("calibrate", data, "-o", data, "--robot", "ur5", "--effects", "none")
    assert data.read_bytes() == (cell / "measured.csv").read_bytes()
    assert is_refused(outcome, "the output is the input")


# validate


def test_validate_prints_the_json_of_the_design_and_nothing_else(truepath, cell):
    outcome = truepath("validate", cell / "fresh.csv", "-c", cell / "ur5.json", "--json")
    content = outcome.json()
    assert outcome.code == 0
    assert list(content) == ["schema", "poses", "nominal", "calibrated"]
    assert (content["schema"], content["poses"]) == ("truepath.validation/1", 60)
    for side in ("nominal", "calibrated"):
        assert set(content[side]) == {"position_mm", "distance_mm", "orientation_mrad"}
        assert set(content[side]["position_mm"]) == {"mean", "rms", "p95", "max"}
    assert content["calibrated"]["position_mm"]["mean"] < 0.04 < 0.5 < content["nominal"]["position_mm"]["mean"]


def test_validate_prints_a_table_for_people(truepath, cell):
    outcome = truepath("validate", cell / "fresh.csv", "-c", cell / "ur5.json", "--robot", "ur5_cell")
    assert outcome.code == 0
    assert "60 poses" in outcome.out
    assert "position, mm" in outcome.out


def test_validate_says_of_poses_that_were_fitted_that_they_prove_nothing(truepath, cell):
    measured = ("validate", cell / "measured.csv", "-c", cell / "ur5.json")
    people, machines = truepath(*measured), truepath(*measured, "--json")
    assert (people.code, machines.code) == (0, 0)
    assert "was made from these very poses" in people.out
    assert "was made from these very poses" in machines.err
    assert list(machines.json()) == ["schema", "poses", "nominal", "calibrated"]
    fresh = truepath("validate", cell / "fresh.csv", "-c", cell / "ur5.json")
    assert "very poses" not in fresh.out + fresh.err


@pytest.mark.parametrize(
    ("bound", "code"),
    [
        (["--max-mean-mm", "0.05"], 0),
        (["--max-mean-mm", "0.01"], 1),
        (["--max-mean-mm", "nan"], 1),
        (["--max-max-mm", "1"], 0),
        (["--max-max-mm", "0.02"], 1),
        (["--max-mean-mm", "0.05", "--max-max-mm", "0.02"], 1),
    ],
    ids=str,
)
def test_a_missed_bound_exits_with_1_and_says_by_how_much(truepath, cell, bound, code):
    outcome = truepath("validate", cell / "fresh.csv", "-c", cell / "ur5.json", "--json", *bound)
    assert outcome.code == code
    assert outcome.json()["poses"] == 60
    assert ("bound missed" in outcome.err) == (code == 1)


def test_the_first_bound_that_is_missed_is_named(truepath, cell):
    outcome = truepath("validate", cell / "fresh.csv", "-c", cell / "ur5.json", "--max-mean-mm", "0.01")
    assert "the mean position error is 0.03" in outcome.err
    assert "more than 0.01 mm" in outcome.err


def test_after_the_tracker_was_moved_a_few_poses_find_the_frames_again(truepath, cell):
    rest = ("validate", cell / "moved_rest.csv", "-c", cell / "ur5.json", "--json", "--max-mean-mm", "0.05")
    assert truepath(*rest).code == 1
    outcome = truepath(*rest, "--refit-frames", cell / "moved_few.csv")
    assert outcome.code == 0
    assert outcome.json()["calibrated"]["position_mm"]["mean"] < 0.05


def test_frames_are_not_found_again_from_poses_that_are_validated(truepath, cell, tmp_path):
    rows = (cell / "moved.csv").read_text().splitlines(keepends=True)
    (tmp_path / "some.csv").write_text("".join([rows[0], *reversed(rows[1:13])]), newline="\r\n")
    for few, shared in ((cell / "moved.csv", "60 of 60"), (tmp_path / "some.csv", "12 of 12")):
        outcome = truepath("validate", cell / "moved.csv", "-c", cell / "ur5.json", "--refit-frames", few)
        assert is_refused(outcome, few.name, "other poses", shared)


def test_a_calibration_of_another_robot_is_refused(truepath, cell):
    outcome = truepath("validate", cell / "fresh.csv", "-c", cell / "ur5.json", "--robot", "ur10")
    assert is_refused(outcome, "belongs to another robot")


def test_a_calibration_that_was_tampered_with_is_refused(truepath, cell, tmp_path):
    text = (cell / "ur5.json").read_text()
    (tmp_path / "cut.json").write_text(text[:-500])
    (tmp_path / "changed.json").write_text(text.replace('"poses": 200', '"poses": 900'))
    assert is_refused(truepath("validate", cell / "fresh.csv", "-c", tmp_path / "cut.json"), "cut off")
    outcome = truepath("correct", WELD_PATH, "-c", tmp_path / "changed.json", "-o", tmp_path / "out.csv")
    assert is_refused(outcome, "was changed")
    assert not (tmp_path / "out.csv").exists()


# correct, export, preview, simulate


def test_correct_writes_a_path_on_which_the_real_robot_is_right(truepath, cell, tmp_path):
    outcome = truepath("correct", WELD_PATH, "-c", cell / "ur5.json", "-o", tmp_path / "weld.csv")
    assert outcome.code == 0
    assert f"written to {tmp_path / 'weld.csv'}" in outcome.out
    real = RealRobot("ur5", 4)
    programmed, corrected = (read_toolpath(path, 6).q_rad for path in (WELD_PATH, tmp_path / "weld.csv"))
    wanted = real.robot.X_WB @ DrakeArm("ur5").flange_poses(programmed) @ real.robot.X_FR
    before, after = (
        np.linalg.norm((real.reflector_poses(q) - wanted)[:, :3, 3], axis=1) for q in (programmed, corrected)
    )
    assert before.mean() > 5e-4
    assert after.max() < 4e-5


def test_export_writes_a_urdf_that_moves_as_the_calibration_says(truepath, cell, tmp_path):
    outcome = truepath("export", "-c", cell / "ur5.json", "-o", tmp_path / "calibrated.urdf")
    assert outcome.code == 0, outcome.err
    model, q = load_calibration(cell / "ur5.json").model, read_toolpath(WELD_PATH, 6).q_rad[::20]
    by_drake = DrakeArm(tmp_path / "calibrated.urdf").flange_poses(q)
    assert np.abs(by_drake - model.flange_poses(q)).max() < 1e-9


def test_export_takes_the_urdf_that_it_is_given(truepath, cell, tmp_path):
    urdf = plants.resolve("ur5")
    assert truepath("export", "-c", cell / "ur5.json", "-o", tmp_path / "c.urdf", "--robot", urdf).code == 0
    other = truepath("export", "-c", cell / "ur5.json", "-o", tmp_path / "d.urdf", "--robot", "ur10")
    assert is_refused(other)
    assert [path.name for path in tmp_path.iterdir()] == ["c.urdf"]


def test_preview_says_which_page_to_open(truepath, cell, tmp_path):
    outcome = truepath("preview", WELD_PATH, "-c", cell / "ur5.json", "-o", tmp_path / "page.html")
    assert outcome.code == 0, outcome.err
    assert f"open {tmp_path / 'page.html'} in a browser" in outcome.out
    assert "<html" in (tmp_path / "page.html").read_text()[:2000].lower()


def test_simulate_is_the_same_robot_for_the_same_seed(truepath, cell, tmp_path):
    same = ("simulate", "--seed", 4, "--poses", 200, "-o", tmp_path / "again.csv")
    outcome = truepath(*same)
    assert outcome.code == 0
    assert f"200 measurements written to {tmp_path / 'again.csv'}" in outcome.out
    assert (tmp_path / "again.csv").read_bytes() == (cell / "measured.csv").read_bytes()
    assert json.loads((cell / "truth.json").read_text())["schema"] == "truepath.truth/1"


def test_simulate_repeats_poses_and_measures_orientation_if_asked(truepath, tmp_path):
    truepath(
        *("simulate", "--poses", 5, "--repeats", 3, "--orientation-noise-mrad", 0.1),
        *("-o", tmp_path / "m.csv", "--robot", "ur10"),
    )
    header, *rows = (tmp_path / "m.csv").read_text().splitlines()
    assert header.endswith("x_mm,y_mm,z_mm,qw,qx,qy,qz,pose_id")
    assert len(rows) == 15


@pytest.mark.parametrize(
    "nonsense",
    [
        ["--poses", 0],
        ["--repeats", 0],
        ["--noise-mm", -1],
        ["--noise-mm", "nan"],
        ["--noise-mm", "inf"],
        ["--seed", -1],
        ["--poses-seed", -1],
        ["--poses", "many"],
        ["--robot", "ur5.stl"],
    ],
    ids=str,
)
def test_simulate_refuses_nonsense_without_a_traceback(truepath, tmp_path, nonsense):
    outcome = truepath("simulate", "-o", tmp_path / "m.csv", *nonsense)
    assert outcome.code == 2
    assert "Traceback" not in outcome.err
    assert list(tmp_path.iterdir()) == []
