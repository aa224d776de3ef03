"""The command line: what it prints, what it writes, how it exits."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command import is_refused
from drake_arm import DrakeArm
from truepath import plants
from truepath.calibration import load_calibration
from truepath.cli import app
from truepath.programs.toolpath_csv import read_toolpath
from truepath.virtual.real_robot import RealRobot
from typer.main import get_command

COMMANDS = ("calibrate", "diagnose", "validate", "correct", "preview", "export", "simulate", "demo")
WELD_PATH = plants.models_dir() / "ur5" / "weld_path.csv"
POSE_PATH = plants.models_dir() / "ur5" / "pose_path.csv"
HEAVY = ("numpy", "scipy", "torch", "pydrake", "casadi", "pydantic", "yourdfpy", "meshcat")


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


# Help


def test_help_tells_a_newcomer_what_there_is(truepath):
    outcome = truepath("--help")
    assert outcome.code == 0
    assert all(command in outcome.out for command in COMMANDS)
    assert "0 good, 1 a stated bound was missed, 2 bad input" in " ".join(outcome.out.split())


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_and_each_of_its_options(truepath, command):
    outcome = truepath(command, "--help")
    assert outcome.code == 0
    assert f" {command} [OPTIONS]" in " ".join(outcome.out.split())
    described = get_command(app).commands[command]
    assert len(described.help) > 20
    assert [option.name for option in described.params if not option.help] == []


def test_the_command_starts_without_its_heavy_libraries():
    code = f"import sys, truepath.cli; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_installed_command_runs_and_passes_its_exit_code_on(tmp_path):
    command = [str(Path(sys.executable).parent / "truepath")]
    if not Path(command[0]).exists():
        pytest.skip("truepath is not installed beside this Python")
    done = subprocess.run(
        [*command, "validate", "no.csv", "-c", "no.json"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert "no.json" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("arguments", [["solder"], ["validate"], ["correct", "x.csv", "--speed", "3"]])
def test_wrong_usage_exits_with_2(truepath, arguments):
    outcome = truepath(*arguments)
    assert outcome.code == 2
    assert "Usage" in outcome.err
    assert "Traceback" not in outcome.err


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


def test_a_folder_that_does_not_exist_is_no_place_to_write_to(truepath, cell, tmp_path):
    outcome = truepath("correct", WELD_PATH, "-c", cell / "ur5.json", "-o", tmp_path / "nowhere" / "c.csv")
    assert is_refused(outcome, "the output cannot be written", "nowhere")
    assert truepath("correct", WELD_PATH, "-c", cell / "ur5.json", "-o", tmp_path).code == 2


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


# correct


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


def test_correct_keeps_every_line_and_every_other_column(truepath, cell, tmp_path):
    truepath("correct", WELD_PATH, "-c", cell / "ur5.json", "-o", tmp_path / "weld.csv")
    before, after = (path.read_text().splitlines() for path in (WELD_PATH, tmp_path / "weld.csv"))
    assert len(after) == len(before)
    assert after[0] == before[0]
    for old, new in zip(before[1:], after[1:], strict=True):
        assert (old.split(",")[0], old.split(",")[-1]) == (new.split(",")[0], new.split(",")[-1])


def test_correct_prints_json_for_machines(truepath, cell, tmp_path):
    outcome = truepath("correct", POSE_PATH, "-c", cell / "ur5.json", "-o", tmp_path / "poses.csv", "--json")
    content = outcome.json()
    assert outcome.code == 0
    assert (content["schema"], content["waypoints"]) == ("truepath.correction/1", 60)
    assert content["output"] == str(tmp_path / "poses.csv")
    assert content["predicted_error_after_mm"]["max"] < 1e-3


def spoiled(cell, tmp_path, line, change):
    """The weld path with one waypoint changed."""
    lines = WELD_PATH.read_text().splitlines()
    cells = lines[line - 1].split(",")
    lines[line - 1] = ",".join(change(cells))
    path = tmp_path / "spoiled.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda cells: [cells[0], "6.3", *cells[2:]], "passes a joint limit"),
        (lambda cells: [*cells[:5], "0.0", *cells[6:]], "the correction"),
        (lambda cells: [cells[0], "", *cells[2:]], "a number is missing"),
        (lambda cells: cells[:-1], "too few cells"),
    ],
    ids=["limit", "singularity", "no number", "short row"],
)
def test_a_waypoint_that_cannot_be_corrected_is_named_and_nothing_is_written(truepath, cell, tmp_path, change, word):
    output = tmp_path / "out.csv"
    outcome = truepath("correct", spoiled(cell, tmp_path, 40, change), "-c", cell / "ur5.json", "-o", output)
    assert is_refused(outcome, "spoiled.csv, line 40", word)
    assert [path.name for path in tmp_path.iterdir()] == ["spoiled.csv"]


BEYOND = ("larger than allowed", "weld_path.csv, line 2")


@pytest.mark.parametrize(
    ("bound", "words"), [("0.1", BEYOND), ("0", BEYOND), ("nan", ("is no length",)), ("-1", ("is no length",))]
)
def test_a_correction_beyond_the_stated_bound_leaves_the_old_output_alone(truepath, cell, tmp_path, bound, words):
    output = tmp_path / "out.csv"
    output.write_text("old")
    outcome = truepath("correct", WELD_PATH, "-c", cell / "ur5.json", "-o", output, f"--max-correction-mm={bound}")
    assert is_refused(outcome, *words)
    assert output.read_text() == "old"


def test_correct_does_not_overwrite_the_program(truepath, cell, tmp_path):
    path = tmp_path / "weld.csv"
    path.write_bytes(WELD_PATH.read_bytes())
    (tmp_path / "link.csv").symlink_to(path)
    for output in (path, tmp_path / "link.csv"):
        assert is_refused(truepath("correct", path, "-c", cell / "ur5.json", "-o", output), "the output is the input")
    assert path.read_bytes() == WELD_PATH.read_bytes()


def test_calibrate_does_not_overwrite_the_measured_data(truepath, cell, tmp_path):
    data = tmp_path / "measured.csv"
    data.write_bytes((cell / "measured.csv").read_bytes())
    outcome = truepath("calibrate", data, "-o", data, "--robot", "ur5", "--effects", "none")
    assert data.read_bytes() == (cell / "measured.csv").read_bytes()
    assert is_refused(outcome, "the output is the input")


@pytest.mark.parametrize("command", ["correct", "export"])
def test_a_calibration_is_not_overwritten_by_what_is_made_with_it(truepath, cell, tmp_path, command):
    calibration = tmp_path / "ur5.json"
    calibration.write_bytes((cell / "ur5.json").read_bytes())
    path = [WELD_PATH] if command == "correct" else []
    outcome = truepath(command, *path, "-c", calibration, "-o", calibration)
    assert calibration.read_bytes() == (cell / "ur5.json").read_bytes()
    assert is_refused(outcome, "the output is the input")


# export, preview, simulate


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
