"""The command that reproduces the paper writes what it prints, and says what is missing or broken."""

import json
import sys
from pathlib import Path

import pytest

# At the end: a test package and a workflow have the same name.
sys.path.append(str(Path(__file__).parents[1] / "workflows"))

import reproduce_paper
from reproduction import cases

QUICK = ("--jobs", "1", "--rows", "before", "kinematic")


class TestCommand:
    def test_writes_what_it_prints(self, tmp_path, capsys):
        files = {name: tmp_path / "new" / f"paper.{name}" for name in ("json", "md")}
        told = ["--json", str(files["json"]), "--markdown", str(files["md"]), "--figures", str(tmp_path / "figures")]
        only = ["--only", "simulation", "--seeds", "1", "--noise-mm", "0.03"]
        assert reproduce_paper.main([*QUICK, *only, *told]) == 0
        report = json.loads(files["json"].read_text())
        assert report["schema"] == "truepath.reproduction/1"
        assert report["cases"][0]["noise_mm"] == 0.03
        assert [row["row"] for row in report["tables"][0]["rows"]] == ["before", "kinematic"]
        assert "0.7411 (0.7411 - 0.7411)" in files["md"].read_text()
        assert "0.7411 (0.7411 - 0.7411)" in capsys.readouterr().out
        assert len(list((tmp_path / "figures").iterdir())) == 2

    def test_without_data_it_says_so(self, tmp_path, capsys, monkeypatch):
        monkeypatch.setenv("TRUEPATH_DATA", str(tmp_path))
        assert reproduce_paper.main([*QUICK, "--only", "experiment", "--splits", "1"]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert "skipped: experiment: no " in said
        assert "set TRUEPATH_DATA to the folder of the published data sets" in said

    def test_the_real_robot(self, data_dir, capsys, monkeypatch):
        monkeypatch.setenv("TRUEPATH_DATA", str(data_dir))
        assert reproduce_paper.main([*QUICK, "--only", "experiment", "--splits", "1"]) == 0
        assert "Table 3: positioning accuracy, experiment (a real UR5), mm" in capsys.readouterr().out

    def test_what_breaks_is_told_and_ends_in_exit_code_1(self, capsys, monkeypatch):
        def breaks(*_):
            raise ValueError("this robot is no good")

        monkeypatch.setattr(cases, "calibrate", breaks)
        assert reproduce_paper.main([*QUICK, "--only", "simulation", "--seeds", "1", "--noise-mm", "0"]) == 1
        assert "this robot is no good" in capsys.readouterr().err

    @pytest.mark.parametrize(
        "wrong", [("--seeds", "0"), ("--jobs", "0"), ("--noise-mm", "-1"), ("--range-deg", "0"), ("--order", "-1")]
    )
    def test_numbers_that_make_no_sense_are_refused(self, wrong, capsys):
        with pytest.raises(SystemExit) as stopped:
            reproduce_paper.main(wrong)
        assert stopped.value.code == 2
        assert "must be larger than 0" in capsys.readouterr().err or wrong[1] == "-1"
