"""The command ``truepath diagnose``: what it writes, what it prints, and that bad input leaves nothing behind."""

import hashlib
import json
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from types import SimpleNamespace

import numpy as np
import pytest
from command import is_refused, run
from hidden import Hidden, soft
from truepath.calibration import load_calibration
from truepath.effects import EFFECTS
from truepath.programs.toolpath_csv import read_toolpath
from truepath.virtual.simulate import to_csv

POSES, WRONG = 150, 17


@pytest.fixture(scope="module")
def data(real_ur5, tmp_path_factory):
    """A file: joint 2 is soft, all lengths are 0.5 % long, one reading is off, every pose in the cell is free."""
    measured = Hidden(real_ur5, soft(real_ur5, 2, 3e-5)).measured(POSES, 40)
    p_ME = 1.005 * measured.p_ME
    p_ME[WRONG] += 0.02
    path = tmp_path_factory.mktemp("measured") / "data.csv"
    path.write_text(to_csv(replace(measured, p_ME=p_ME)))
    return path


@pytest.fixture(scope="module")
def few(data):
    """The first forty rows of it."""
    path = data.parent / "few.csv"
    path.write_text("".join(data.read_text().splitlines(keepends=True)[:41]))
    return path


@pytest.fixture(scope="module")
def folder(data, tmp_path_factory):
    """Where the results are, two folders deep, neither of which was there."""
    return tmp_path_factory.mktemp("results") / "a" / "b"


def diagnosed(*arguments):
    """Outcome of the command, run once for many tests."""
    out, err = StringIO(), StringIO()
    silent = SimpleNamespace(readouterr=lambda: SimpleNamespace(out="", err=""))
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        result = run(patch, silent, "diagnose", *arguments, "--robot", "ur5_cell")
    result.out, result.err = out.getvalue(), err.getvalue()
    return result


@pytest.fixture(scope="module")
def outcome(data, folder):
    """Of the command."""
    return diagnosed(data, "-o", folder)


@pytest.fixture(scope="module")
def content(outcome, folder):
    """Of diagnosis.json."""
    assert outcome.code == 0, outcome.err
    return json.loads((folder / "diagnosis.json").read_text(), parse_constant=pytest.fail)


# The files


def test_diagnosis_report_calibration_and_poses_are_written_and_nothing_else(content, folder):
    names = {item["measure_next"] for item in content["ambiguous"] if item["measure_next"]}
    assert names
    written = {path.name for path in folder.iterdir()}
    assert written == {"diagnosis.json", "report.html", "calibration.json"} | names


def test_the_command_says_what_it_found_and_what_it_wrote(outcome, content, folder):
    said = " ".join(outcome.out.split())
    assert content["verdict"] in said
    assert "joint compliance" in said
    assert f"error on {content['data']['unseen_poses']} poses kept away, mm" in said
    assert f"{POSES}" not in said.split("written:")[1]
    for path in folder.iterdir():
        assert path.name in said


def test_the_calibration_holds_the_finding(folder, content):
    effects = load_calibration(folder / "calibration.json").effects
    named = {(finding["effect"], joint) for finding in content["findings"] for joint in finding["joints"]}
    assert {(effect.name, effect.joint) for effect in effects} == named == {("joint_compliance", 2)}


def test_the_poses_to_measure_next_are_a_path_within_limits_and_free_of_collision(folder, content, real_ur5, ur5):
    for item in content["ambiguous"]:
        q = read_toolpath(folder / item["measure_next"], 6).q_rad
        assert len(q) >= 10
        assert (q > ur5.lower_rad).all()
        assert (q < ur5.upper_rad).all()
        assert all(real_ur5.is_free(row) for row in q)


def test_the_report_is_one_page_that_names_the_cause(folder):
    text = (folder / "report.html").read_text()
    assert "<html" in text[:500].lower()
    assert "ompliance" in text


# diagnosis.json, key by key as the design has it


def test_the_content_says_which_schema_it_follows(content):
    assert content["schema"] == "truepath.diagnosis/1"
    assert {"schema", "data", "stages", "findings", "ambiguous", "unexplained"} <= set(content)


def test_the_data_are_known_by_name_hash_and_number_and_wrong_rows_by_number_from_1(content, data):
    expected = {"file": "data.csv", "sha256": hashlib.sha256(data.read_bytes()).hexdigest(), "poses": POSES}
    assert expected.items() <= content["data"].items()
    assert content["data"]["outliers"] == [WRONG + 1]


def test_stages_grow_from_nominal_and_kinematic_by_one_finding_at_a_time(content):
    models = [stage["model"] for stage in content["stages"]]
    effects = [finding["effect"] for finding in content["findings"]]
    assert models == [
        "nominal",
        "kinematic",
        *("+".join(["kinematic", *effects[: k + 1]]) for k in range(len(effects))),
    ]
    for stage in content["stages"]:
        assert set(stage["heldout_mm"]) == {"mean", "p95", "max"}
        assert 0 < stage["heldout_mm"]["mean"] <= stage["heldout_mm"]["p95"] <= stage["heldout_mm"]["max"]


def test_findings_are_complete_and_in_order_of_their_gain(content):
    gains = []
    for finding in content["findings"]:
        assert finding["effect"] in EFFECTS
        assert all(isinstance(joint, int) and 1 <= joint <= 6 for joint in finding["joints"])
        assert finding["cause"] == EFFECTS[finding["effect"]].cause
        assert finding["remedy"] == EFFECTS[finding["effect"]].remedy
        assert 0 <= finding["p_value"] <= 0.01
        gain = finding["heldout_gain_mm"]
        assert set(gain) == {"before", "after", "ci95"}
        assert gain["ci95"][0] < gain["before"] - gain["after"] < gain["ci95"][1]
        gains.append(gain["before"] - gain["after"])
        for parameter in finding["parameters"]:
            assert set(parameter) == {"name", "joint", "value", "sigma", "unit"}
            assert parameter["sigma"] > 0
    assert gains == sorted(gains, reverse=True)


def test_doubts_name_effects_of_the_vocabulary_or_the_geometry_and_say_why(content):
    assert content["ambiguous"]
    for item in content["ambiguous"]:
        assert {"effects", "why", "measure_next"} <= set(item)
        assert set(item["effects"]) <= {*EFFECTS, "kinematic"}
        assert len(item["why"]) > 40
    assert any("measurement_scale" in item["effects"] for item in content["ambiguous"])


def test_what_is_left_comes_with_its_chance_and_the_noise_floor(content):
    left = content["unexplained"]
    assert {"structured", "p_value", "heldout_mm", "noise_floor_mm"} <= set(left)
    assert left["structured"] is False
    assert 0 <= left["p_value"] <= 1
    assert left["heldout_mm"] == content["stages"][-1]["heldout_mm"]["mean"]
    assert left["noise_floor_mm"] == pytest.approx(0.02 * np.sqrt(8 / np.pi), rel=0.3)


# Other ways to ask


@pytest.fixture(scope="module")
def crowded(few, tmp_path_factory):
    """A folder with an older diagnosis, which names no file, and files of the customer: the data, and his own poses."""
    folder = tmp_path_factory.mktemp("crowded")
    for name in ("diagnosis.json", "report.html", "calibration.json", "poses.csv", "poses_for_tuesday.csv"):
        (folder / name).write_text("old")
    (folder / "poses_monday.csv").write_bytes(few.read_bytes())
    return folder


@pytest.fixture(scope="module")
def for_machines(crowded):
    """Of the command with that folder and ``--json``."""
    return diagnosed(crowded / "poses_monday.csv", "-o", crowded, "--json")


def test_json_for_machines_is_the_content_of_the_file(for_machines, crowded):
    assert for_machines.code == 0
    assert for_machines.json() == json.loads((crowded / "diagnosis.json").read_text())


def test_an_older_diagnosis_is_replaced_as_a_whole(for_machines, crowded):
    assert for_machines.json()["data"]["poses"] == 40
    assert "old" not in [(crowded / name).read_text() for name in ("report.html", "calibration.json")]


def test_files_of_the_customer_beside_the_results_stay_whatever_they_are_called(for_machines, crowded, few):
    assert (crowded / "poses_monday.csv").read_bytes() == few.read_bytes()
    assert (crowded / "poses_for_tuesday.csv").read_text() == (crowded / "poses.csv").read_text() == "old"


def test_what_to_measure_next_then_has_another_name(for_machines, crowded):
    names = {item["measure_next"] for item in for_machines.json()["ambiguous"]} - {None}
    assert "poses.csv" not in names
    assert all(len(read_toolpath(crowded / name, 6).q_rad) >= 10 for name in names)
    assert 'href="./measure_next.csv"' in (crowded / "report.html").read_text()


def test_calibrate_with_effects_auto_learns_the_very_same_robot(truepath, data, folder, content, tmp_path):
    outcome = truepath("calibrate", data, "--robot", "ur5_cell", "--effects", "auto", "-o", tmp_path / "c.json")
    assert outcome.code == 0, outcome.err
    files = (tmp_path / "c.json", folder / "calibration.json")
    mine, theirs = (load_calibration(path).model_dump(exclude={"created_utc"}) for path in files)
    assert mine == theirs


def test_too_few_poses_to_spare_any_still_give_a_calibration_and_a_report(truepath, data, tmp_path):
    dozen = tmp_path / "dozen.csv"
    dozen.write_text("".join(data.read_text().splitlines(keepends=True)[:14]))
    outcome = truepath("diagnose", dozen, "--robot", "ur5_cell", "-o", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert json.loads((tmp_path / "out" / "diagnosis.json").read_text(), parse_constant=pytest.fail)["findings"] == []
    assert (tmp_path / "out" / "report.html").exists()


# What is refused


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--robot", "ur7"], "no robot 'ur7'"),
        (["--robot", "ur10"], "another robot"),
        (["--robot", "ur5_cell", "--format", "excel"], "unknown format 'excel'"),
        (["--robot", "ur5_cell", "--measured-in", "moon"], "unknown measurement frame 'moon'"),
        (["--robot", "ur5_cell", "--probe", "1,2"], "cannot read the place of the probe '1,2'"),
    ],
)
def test_wrong_options_are_refused_and_no_folder_is_made(truepath, data, tmp_path, options, word):
    assert is_refused(truepath("diagnose", data, "-o", tmp_path / "out", *options), word)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fault", ["text", "cut", "empty", "units"])
def test_data_with_a_fault_are_refused_and_no_folder_is_made(truepath, data, tmp_path, fault):
    text = data.read_text()
    lines = text.splitlines(keepends=True)
    spoilt = {
        "text": "".join([*lines[:5], lines[5].replace(lines[5].split(",")[7], "oops"), *lines[6:]]),
        "cut": text[: len(text) // 2],
        "empty": "",
        "units": text.replace("x_mm", "x_inch"),
    }
    bad = tmp_path / "bad.csv"
    bad.write_text(spoilt[fault])
    assert is_refused(truepath("diagnose", bad, "--robot", "ur5_cell", "-o", tmp_path / "out"), "bad.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["bad.csv"]


def test_too_few_poses_for_the_kinematics_are_refused(truepath, data, tmp_path):
    seven = tmp_path / "seven.csv"
    seven.write_text("".join(data.read_text().splitlines(keepends=True)[:8]))
    outcome = truepath("diagnose", seven, "--robot", "ur5_cell", "-o", tmp_path / "out")
    assert is_refused(outcome, "seven.csv", "too few poses")
    assert not (tmp_path / "out").exists()


def test_results_do_not_go_into_a_file(truepath, few, tmp_path):
    target = tmp_path / "out"
    target.write_text("a file")
    assert is_refused(truepath("diagnose", few, "--robot", "ur5_cell", "-o", target), "folder")
    assert target.read_text() == "a file"


def test_a_folder_that_cannot_be_made_is_refused(truepath, few, tmp_path):
    (tmp_path / "file").write_text("a file")
    assert is_refused(truepath("diagnose", few, "--robot", "ur5_cell", "-o", tmp_path / "file" / "out"), "out")
    assert (tmp_path / "file").read_text() == "a file"


@pytest.mark.parametrize("name", ["calibration.json", "diagnosis.json", "report.html"])
def test_where_a_folder_stands_in_the_way_of_a_file_nothing_is_written(truepath, few, tmp_path, name):
    (tmp_path / name).mkdir()
    assert is_refused(truepath("diagnose", few, "--robot", "ur5_cell", "-o", tmp_path), name)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_the_measured_data_are_not_overwritten_by_a_result(truepath, few, tmp_path):
    mine = tmp_path / "report.html"
    mine.write_bytes(few.read_bytes())
    assert is_refused(truepath("diagnose", mine, "--robot", "ur5_cell", "-o", tmp_path), "the output is the input")
    assert mine.read_bytes() == few.read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
