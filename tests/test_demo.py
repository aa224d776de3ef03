"""The demo: everything on the virtual cell, a gain that Drake confirms, and a picture with nothing done by hand."""

import csv
import json
import os
import pty
import subprocess
import time
from html import unescape
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
from command import run
from opened_page import BLUE, LAPTOP, OpenPage, pixels_of
from truepath import plants
from truepath.calibration import load_calibration
from truepath.demo import run_demo
from truepath.errors import InputError
from truth_by_drake import reflector_poses

ROOT = Path(__file__).parents[1]
LIMIT_S = 60.0
NOT_INTERACTIVE = ("CI", "SSH_CONNECTION", "SSH_TTY")


@pytest.fixture(scope="module")
def said():
    return []


@pytest.fixture(scope="module")
def demo(tmp_path_factory, said):
    """Folder, result and seconds."""
    folder = tmp_path_factory.mktemp("demo") / "results"
    start = time.perf_counter()
    result = run_demo(folder, 0, said.append)
    return folder, result, time.perf_counter() - start


def joints_in(path):
    with path.open(newline="") as file:
        return np.array([[float(row[f"q{i}_rad"]) for i in range(1, 7)] for row in csv.DictReader(file)])


def test_the_demo_takes_less_than_a_minute(demo):
    assert demo[2] < LIMIT_S


def test_every_file_is_there(demo):
    folder, result, _ = demo
    names = {path.name for path in folder.iterdir()}
    assert names - {"poses.csv", "poses2.csv"} == {
        *("measured.csv", "truth.json", "diagnosis.json", "report.html", "calibration.json"),
        *("weld_path.corrected.csv", "weld_path.corrected.csv.truepath.json", "preview.html"),
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
        assert (where, seed) == (folder, 0)
        return result

    def command(*options, browser=True):
        monkeypatch.setattr("truepath.demo.run_demo", again)
        monkeypatch.setattr("webbrowser.open", lambda address: asked.append(address) or browser)
        outcome = run(monkeypatch, capsys, "demo", "--folder", folder, *options)
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


# From the command that ``make demo`` runs to a picture in a browser


def on_a_terminal(command, environment):
    """Runs a command whose output goes to a terminal; returns that output."""
    ours, theirs = pty.openpty()
    done = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment, close_fds=True)
    os.close(theirs)
    said = b""
    try:
        while part := os.read(ours, 4096):
            said += part
    except OSError:  # the other end is closed
        pass
    os.close(ours)
    assert done.wait() == 0, said.decode()
    return said.decode()


@pytest.fixture(scope="module")
def first_sight(browser, tmp_path_factory):
    """The page that the command opened, what it said, seconds from its start to the first picture, and its folder."""
    folder = tmp_path_factory.mktemp("first sight")
    asked, recorder, results = folder / "asked for", folder / "browser", folder / "demo"
    results.mkdir()
    (results / "calibration.json").write_text("of an earlier run")
    recorder.write_text(f"#!/bin/sh\nprintf '%s\\n' \"$1\" >> '{asked}'\n")
    recorder.chmod(0o755)
    environment = {name: value for name, value in os.environ.items() if name not in NOT_INTERACTIVE}
    environment |= {"DISPLAY": ":0", "BROWSER": f"'{recorder}' %s", "COLUMNS": "120"}
    start = time.perf_counter()
    said = on_a_terminal([str(ROOT / ".venv/bin/truepath"), "demo", "--folder", str(results)], environment)
    asked_after = time.perf_counter() - start
    (address,) = asked.read_text().splitlines()
    page = OpenPage(browser, Path(unquote(urlsplit(address).path)), LAPTOP)
    yield page, said, asked_after + page.ready_after_s(), results
    page.tab.close()


def test_make_demo_is_that_command():
    plan = subprocess.run(
        ["make", "--no-print-directory", "-n", "demo"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert plan.stdout.strip().splitlines()[-1] == ".venv/bin/truepath demo"


def test_the_first_picture_is_there_within_a_minute_and_no_step_by_hand(first_sight):
    page, said, took, _ = first_sight
    print(f"first sight after {took:.1f} s, {page.ready_after_s():.1f} s of them in the browser")
    assert took < LIMIT_S
    assert "the preview is open in a browser" in said
    assert pixels_of(BLUE, page.scene()) > 50  # the corrected path
    assert page.complaints == []


def test_the_one_page_leads_to_the_report(first_sight):
    page, *_ = first_sight
    page.tab.get_by_role("link", name="the report").click()
    page.tab.wait_for_url("**/report.html")
    assert "joint compliance" in page.tab.inner_text("body").lower()
    assert page.complaints == []


def test_another_run_replaces_the_results_by_the_same(demo, first_sight):
    first, again = demo[0], first_sight[3]
    assert {path.name for path in again.iterdir()} == {path.name for path in first.iterdir()}
    for name in ("measured.csv", "weld_path.corrected.csv"):
        assert (again / name).read_bytes() == (first / name).read_bytes()
    assert load_calibration(again / "calibration.json").data.poses == 300
