"""The demo: everything on the virtual cell, and a gain that Drake confirms."""

import csv
import json
import time
from html import unescape

import numpy as np
import pytest
from truepath import plants
from truepath.calibration import load_calibration
from truepath.demo import run_demo
from truepath.errors import InputError
from truth_by_drake import reflector_poses


@pytest.fixture(scope="module")
def said():
    return []


@pytest.fixture(scope="module")
def demo(tmp_path_factory, said):
    """Folder, result and seconds."""
    folder = tmp_path_factory.mktemp("demo") / "results"
    start = time.perf_counter()
    result = run_demo(folder, 1, said.append)
    return folder, result, time.perf_counter() - start


def joints_in(path):
    with path.open(newline="") as file:
        return np.array([[float(row[f"q{i}_rad"]) for i in range(1, 7)] for row in csv.DictReader(file)])


def test_the_demo_takes_less_than_a_minute(demo):
    assert demo[2] < 60


def test_every_file_is_there(demo):
    folder, result, _ = demo
    names = {path.name for path in folder.iterdir()}
    assert names - {"poses.csv", "poses2.csv"} == {
        *("measured.csv", "truth.json", "diagnosis.json", "report.html", "calibration.json"),
        *("weld_path.corrected.csv", "preview.html"),
    }
    assert result.report == folder / "report.html"
    assert result.preview == folder / "preview.html"
    assert load_calibration(folder / "calibration.json").data.poses == 300


def test_the_diagnosis_names_what_was_hidden_and_nothing_else(demo):
    folder, result, _ = demo
    hidden = {
        cause["effect"]: cause["joints"] for cause in json.loads((folder / "truth.json").read_text())["hidden_causes"]
    }
    assert hidden.keys() == {"joint_compliance", "transmission_error"}
    diagnosis = json.loads((folder / "diagnosis.json").read_text())
    assert {finding["effect"]: finding["joints"] for finding in diagnosis["findings"]} == hidden
    assert result.verdict == diagnosis["verdict"]
    assert "joint compliance" in result.verdict
    assert "transmission error" in result.verdict
    assert result.verdict in unescape((folder / "report.html").read_text())


def test_the_stated_gain_is_the_one_that_drake_finds_from_the_files_alone(demo):
    folder, result, _ = demo
    truth = json.loads((folder / "truth.json").read_text())
    programmed = joints_in(plants.models_dir() / "ur5" / "weld_path.csv")
    corrected = joints_in(folder / "weld_path.corrected.csv")
    wanted = reflector_poses({}, programmed)
    before, after = (
        1e3 * np.linalg.norm((reflector_poses(truth, q) - wanted)[:, :3, 3], axis=1) for q in (programmed, corrected)
    )
    assert result.before_mm == pytest.approx(before, abs=1e-6)
    assert result.after_mm == pytest.approx(after, abs=1e-6)


def test_the_tool_error_falls_from_millimetres_to_below_the_noise(demo):
    _, result, _ = demo
    assert result.before_mm.mean() > 0.5
    assert result.after_mm.mean() < 0.02
    assert result.after_mm.max() < 0.04


def test_fresh_poses_confirm_it(demo):
    _, result, _ = demo
    assert result.validation.poses == 200
    assert result.validation.calibrated.position_mm.mean < 0.04 < result.validation.nominal.position_mm.mean / 10


def test_it_says_what_it_is_doing(demo, said):
    assert demo
    assert len(said) >= 4


def test_another_run_replaces_the_results(demo, tmp_path):
    folder, result, _ = demo
    (tmp_path / "calibration.json").write_text("old")
    again = run_demo(tmp_path, 1, lambda _: None)
    assert np.array_equal(again.after_mm, result.after_mm)
    assert (tmp_path / "measured.csv").read_bytes() == (folder / "measured.csv").read_bytes()
    assert load_calibration(tmp_path / "calibration.json").data.poses == 300


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot make the folder"):
        run_demo(tmp_path / "file" / "demo", 0, lambda _: None)


def test_a_negative_seed_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(InputError, match="seed"):
        run_demo(tmp_path / "demo", -1, lambda _: None)
    assert list(tmp_path.iterdir()) == []


def test_the_command_ends_by_saying_what_was_gained_and_where_to_look(monkeypatch, capsys, tmp_path):
    from truepath.cli import main

    monkeypatch.setattr("sys.argv", ["truepath", "demo", "--folder", str(tmp_path / "results")])
    with pytest.raises(SystemExit) as stop:
        main()
    assert not stop.value.code
    verdict, *_, gain, _, report, preview = capsys.readouterr().out.strip().splitlines()
    assert verdict == json.loads((tmp_path / "results" / "diagnosis.json").read_text())["verdict"]
    assert "computed by Drake" in gain
    assert "times better" in gain
    assert str(tmp_path / "results" / "report.html") in report
    assert str(tmp_path / "results" / "preview.html") in preview
