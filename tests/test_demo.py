"""The demo: everything on the virtual cell, and a gain that Drake confirms."""

import csv
import json
import time
from html import unescape

import numpy as np
import pytest
from command import run
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


@pytest.fixture
def command(demo, monkeypatch, capsys):
    """The command on the results that are there already: code, lines of output, addresses that were opened."""
    folder, result, _ = demo
    asked = []

    def again(where, seed, say):
        assert (where, seed) == (folder, 1)
        return result

    def command(*options, browser=True):
        monkeypatch.setattr("truepath.demo.run_demo", again)
        monkeypatch.setattr("webbrowser.open", lambda address: asked.append(address) or browser)
        outcome = run(monkeypatch, capsys, "demo", "--folder", folder, "--seed", 1, *options)
        return outcome.code, outcome.out.strip().splitlines(), asked

    return command


def test_the_command_ends_by_saying_what_was_gained_and_where_to_look(demo, command):
    folder = demo[0]
    code, (verdict, *_, gain, where, preview, report), asked = command()
    assert code == 0
    assert verdict == json.loads((folder / "diagnosis.json").read_text())["verdict"]
    assert "computed by Drake" in gain
    assert "times better" in gain
    assert where == "open in a browser:"
    assert str(folder / "preview.html") in preview
    assert str(folder / "report.html") in report
    assert asked == []  # nobody looks on: this is no terminal


def test_it_opens_the_page_where_it_is_told_to(demo, command):
    _, lines, asked = command("--open")
    assert asked == [(demo[0] / "preview.html").as_uri()]
    assert lines[-3] == "the preview is open in a browser:"


def test_it_opens_nothing_where_it_is_told_not_to(command, monkeypatch):
    monkeypatch.setattr("truepath.browser.somebody_looks_on", lambda: True)
    assert command("--no-open")[2] == []
    assert len(command()[2]) == 1


def test_without_a_browser_it_says_so_and_where_to_look(command):
    code, lines, _ = command("--open", browser=False)
    assert code == 0
    assert lines[-4] == "no browser could be started"
    assert lines[-3] == "open in a browser:"
