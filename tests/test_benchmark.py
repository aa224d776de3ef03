"""The benchmark runs without its peers and without data, says what it left out, and computes its ratios right."""

import importlib.util
import json
import re
from pathlib import Path

import pytest
from truepath.effects import EFFECTS

ROOT = Path(__file__).parents[1]
SCRIPT = ROOT / "workflows" / "benchmark.py"
QUICK = ("--rounds", "1", "--waypoints", "200", "--sample", "3", "--lines", "500", "--generations", "3")
GENERATION = {"individuals": 200, "largest": 40, "poses": 1000, "batched_s": 0.01, "torch_s": 0.25, "numpy_s": 0.05}
GENERATION["dearest"] = {"neurons_of_the_best": 40, "batched_s": 0.02, "torch_s": 0.44}


def script(path: Path):
    spec = importlib.util.spec_from_file_location(f"truepath_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def benchmark():
    return script(SCRIPT)


@pytest.fixture
def no_peers(tmp_path) -> tuple[str, str]:
    return "--peers", str(tmp_path / "absent")


def peers_that(tmp_path: Path, script: str) -> tuple[str, str]:
    """An environment whose python is a shell script."""
    python = tmp_path / "peers" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(f"#!/bin/sh\n{script}\n")
    python.chmod(0o755)
    return "--peers", str(tmp_path / "peers")


def rows_by_name(report: dict) -> dict:
    return {row["what"].split(",")[0]: row for row in report["rows"] if "worst" not in row["what"]}


@pytest.fixture
def answers(benchmark, monkeypatch) -> dict[str, dict]:
    """The parts that have scripts of their own answer at once; whoever adds an answer spares one more process."""
    corrected = {"per_waypoint_us": 2.5, "ik_per_waypoint_us": 300.0, "max_error_um": 1e-6, "ik_max_error_um": 2.0}
    run, answers = benchmark._run, {"correction_benchmark.py": {**corrected, "waypoints": 200}}
    answers["program_benchmark.py"] = {"lines": 500, "command_s": 3.0, "parse_and_write_share": 0.4}
    answers["generation_benchmark.py"] = GENERATION

    def answer(command: list[str], **options) -> dict:
        words = [Path(word).name for word in command]
        return next((answers[word] for word in words if word in answers), None) or run(command, **options)

    monkeypatch.setattr(benchmark, "_run", answer)
    return answers


def test_without_peer_and_data_it_says_so_and_still_compares_the_correction(
    benchmark, answers, tmp_path, no_peers, monkeypatch, capsys
):
    monkeypatch.setenv("TRUEPATH_DATA", str(tmp_path))
    del answers["correction_benchmark.py"]
    code = benchmark.main([*QUICK, *no_peers])
    printed = capsys.readouterr().out
    assert code == int(len(re.findall(r"no +│\n", printed)) > 0), printed  # the last column
    assert "skipped: kinematic solve: no " in printed
    assert "TRUEPATH_DATA" in printed
    assert "Drake IK" in printed
    assert "one at a time, torch" in printed


@pytest.mark.usefixtures("answers")
def test_without_peer_the_own_numbers_are_given(benchmark, data_dir, no_peers, monkeypatch, capsys):
    monkeypatch.setenv("TRUEPATH_DATA", str(data_dir))
    code = benchmark.main([*QUICK, *no_peers, "--json"])
    report = json.loads(capsys.readouterr().out)
    assert code == 0
    assert report["schema"] == "truepath.benchmark/1"
    assert "make bench" in report["skipped"][0]
    solve = rows_by_name(report)["kinematic solve"]
    assert solve["what"] == "kinematic solve, 800 poses"
    assert 0 < solve["truepath"] < 60
    assert (solve["peer"], solve["ratio"], solve["met"]) == (None, None, None)
    (split,) = (result["split"] for result in report["details"]["solve"]["truepath"])
    assert (split["poses"], split["heldout_poses"]) == (640, 160)
    assert 0.09 < split["train_mean_mm"] < 0.11
    assert 0.09 < split["heldout_mean_mm"] < 0.12
    benchmark.print_table(report)
    assert "skipped: robotkinecal" in capsys.readouterr().out


@pytest.fixture
def canned(answers, tmp_path, monkeypatch):
    """truepath's own processes answer at once; the peer's process is a real one."""
    csv = tmp_path / "data" / "ur5_jacobi2025" / "grid.csv"
    csv.parent.mkdir(parents=True)
    csv.write_text("a header\n" + "a row\n" * 20)
    monkeypatch.setenv("TRUEPATH_DATA", str(tmp_path / "data"))
    answers["--solve-ours"] = {"solve_s": 0.1, "train_mean_mm": 0.1, "heldout_mean_mm": 0.1, "poses": 20}


@pytest.mark.usefixtures("canned")
def test_ratios_and_requirements(benchmark, tmp_path, capsys):
    said = '{"solve_s": 2.5, "train_mean_mm": 0.0994, "heldout_mean_mm": 0.0996, "poses": 20}'
    assert benchmark.main(["--rounds", "2", *peers_that(tmp_path, f"echo '{said}'"), "--json"]) == 1  # one is missed
    report = json.loads(capsys.readouterr().out)
    assert report["skipped"] == []
    rows = {row["what"]: row for row in report["rows"]}
    assert rows["kinematic solve, 20 poses"]["ratio"] == pytest.approx(25.0)
    assert rows["kinematic solve, 20 poses"]["met"] is True
    assert rows["mean error, poses in the fit (80 %)"]["met"] is False  # 0.6 um worse
    assert rows["mean error, poses held out (20 %)"]["met"] is True  # 0.4 um worse: a tie
    correction = rows["correction, 200 waypoints, all effects, time for each"]
    assert correction["ratio"] == pytest.approx(120.0)
    assert (correction["required"], correction["met"]) == ("ratio >= 100", True)
    assert rows["program of 500 lines, whole command"]["truepath"] == 3.0
    share = rows["program of 500 lines, share of reading and writing"]
    assert (share["truepath"], share["required"], share["met"]) == (0.4, "<= 0.5", True)
    dearest = rows["a generation of 200 networks, all trials of 40 neurons (the dearest)"]
    assert dearest["ratio"] == pytest.approx(22.0)
    assert (dearest["required"], dearest["met"]) == ("ratio >= 20", True)
    by_peer = {row["peer_name"]: row for row in report["rows"] if row is not dearest}
    assert by_peer["one at a time, torch"]["ratio"] == pytest.approx(25.0)
    assert by_peer["one at a time, torch"]["met"] is True
    assert by_peer["one at a time, numpy"]["ratio"] == pytest.approx(5.0)


@pytest.mark.usefixtures("canned")
def test_both_sides_get_the_same_rows_and_every_row_is_held_out_once(benchmark, tmp_path, capsys):
    keep = (
        f'for last; do :; done; case "$last" in *.json) cat "$last" >> {tmp_path}/rows; echo >> {tmp_path}/rows;; esac'
    )
    said = '{"solve_s": 1, "train_mean_mm": 1, "heldout_mean_mm": 1, "poses": 20}'
    assert benchmark.main([*peers_that(tmp_path, f"{keep}; echo '{said}'"), "--json"]) == 1
    fitted = [json.loads(line) for line in (tmp_path / "rows").read_text().splitlines()]
    assert [len(rows) for rows in fitted] == [16] * 5
    held_out = [row for rows in fitted for row in set(range(20)) - set(rows)]
    assert sorted(held_out) == list(range(20))


@pytest.mark.usefixtures("canned")
def test_a_peer_that_fails_is_reported_not_fatal(benchmark, tmp_path, capsys):
    broken = peers_that(tmp_path, "echo 'ModuleNotFoundError: no robotkinecal' >&2; exit 1")
    assert benchmark.main([*broken, "--json"]) == 0
    (message,) = json.loads(capsys.readouterr().out)["skipped"]
    assert "exit code 1: ModuleNotFoundError: no robotkinecal" in message


@pytest.mark.parametrize("wrong", [("--rounds", "0"), ("--rounds", "6"), ("--sample", "0")])
def test_numbers_that_make_no_sense_are_refused(benchmark, wrong, capsys):
    with pytest.raises(SystemExit) as stopped:
        benchmark.main(wrong)
    assert stopped.value.code == 2
    assert "--rounds must be 1 to 5" in capsys.readouterr().err


@pytest.mark.parametrize(("theirs_us", "met"), [(299.0, False), (301.0, True)])
def test_a_correction_less_than_a_hundred_times_as_fast_is_a_miss(benchmark, theirs_us, met, monkeypatch, capsys):
    result = {"waypoints": 9, "per_waypoint_us": 3.0, "ik_per_waypoint_us": theirs_us, "max_error_um": 0.1}
    row, accuracy = benchmark._correction_rows({**result, "ik_max_error_um": 1.0})
    assert (row["met"], accuracy["met"]) == (met, None)
    alone = script(SCRIPT.with_name("correction_benchmark.py"))
    monkeypatch.setattr(alone, "correct_ours", lambda *_: result)
    assert alone.main([]) == int(not met)
    assert json.loads(capsys.readouterr().out) == result


def test_drake_and_truepath_reach_the_same_poses():
    result = script(SCRIPT.with_name("correction_benchmark.py")).correct_ours(waypoints=150, sample=5, repeat=1)
    assert result["effects"] == sorted(EFFECTS)
    assert result["ik_solved"] == result["ik_waypoints"] == 5
    assert result["max_error_um"] < 1.0
    assert result["ik_max_error_um"] < 10.0
