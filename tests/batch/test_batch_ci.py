"""The example of a CI job is one: it is valid, and what it runs exists and does what it says."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from small_programs import OUT_OF_REACH, SCRIPT, program, workflow
from truepath.cli import app
from typer.main import get_command

ROOT = SCRIPT.parents[1]
EXAMPLE = ROOT / "workflows" / "ci" / "correct-programs.yml"


@pytest.fixture(scope="module")
def job():
    return yaml.safe_load(EXAMPLE.read_text(encoding="utf-8"))


def steps(job):
    return job["jobs"]["correct"]["steps"]


def scripts(job):
    return {step["name"]: step["run"] for step in steps(job) if "run" in step}


def commands(script):
    """Words of each command of a script, its lines joined."""
    for line in script.replace("\\\n", " ").splitlines():
        if re.match(r"\s*(python |truepath )", line) and "<<" not in line:
            yield shlex.split(line.split("||")[0])


def test_it_has_what_a_workflow_needs(job):
    assert {"name", "env", "permissions", "jobs"} <= set(job)
    assert job[True]["pull_request"]["paths"] == job[True]["push"]["paths"]  # YAML 1.1 reads "on" as true
    assert job["permissions"] == {"contents": "read"}
    for step in steps(job):
        assert len({"uses", "run"} & set(step)) == 1
    used = [step["uses"] for step in steps(job) if "uses" in step]
    assert all(re.fullmatch(r"actions/[a-z-]+@v\d+", each) for each in used)
    kept = {step["with"]["name"] for step in steps(job) if "upload-artifact" in step.get("uses", "")}
    assert kept == {"report", "corrected-programs", "previews"}


def test_every_command_exists_with_every_option_that_it_uses(job):
    used = set()
    for script in scripts(job).values():
        for words in commands(script):
            if words[1].endswith("batch_correct.py"):
                numbers = ["3" if word == "$MAX_CORRECTION_MM" else word for word in words[2:]]
                workflow().parser().parse_args(numbers)
                assert (ROOT / Path(words[1]).relative_to(".truepath")).is_file()
            elif words[0] == "truepath":
                command = get_command(app).commands[words[1]]
                known = {option for each in command.params for option in each.opts}
                assert {word for word in words[2:] if word.startswith("-")} <= known
            else:
                assert words[:4] == ["python", "-m", "pip", "install"]
                assert words[4:6] == ["--constraint", ".truepath/constraints.txt"]
            used.add(Path(words[1]).name)
    assert used == {"batch_correct.py", "preview", "-m"}


@pytest.fixture
def runner(job, calibration, tmp_path):
    """Function: does the steps as GitHub does, but for the installation; gives exit codes by name."""
    pytest.importorskip("distributed", reason="needs the extra 'batch'")
    (tmp_path / ".truepath").symlink_to(ROOT)
    (tmp_path / "calibration").mkdir()
    (tmp_path / "calibration" / "calibration.json").write_bytes(calibration.read_bytes())
    place = {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "OMP_NUM_THREADS": "1"}

    def runner(only=None, **changed):
        codes = {}
        for name, script in scripts(job).items():
            if name == "Install truepath" or only not in (None, name):
                continue
            stated = {key: str(value) for key, value in {**job["env"], **changed}.items()}
            shell = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script]
            done = subprocess.run(
                shell, cwd=tmp_path, env={**os.environ, **place, **stated}, capture_output=True, text=True, check=False
            )
            codes[name] = done.returncode
            print(done.stdout, done.stderr)
        return codes

    return runner


def test_it_keeps_report_programs_and_previews(runner, tmp_path):
    (tmp_path / "programs" / "cell one").mkdir(parents=True)
    (tmp_path / "programs" / "cell one" / "a.script").write_text(program(1))
    assert runner() == {"Correct all programs": 0, "Check bounds": 0, "Previews": 0}
    assert (tmp_path / "corrected" / "batch.html").is_file()
    assert (tmp_path / "corrected" / "cell one" / "a.script").is_file()
    assert (tmp_path / "previews" / "cell one" / "a.script.html").is_file()
    assert runner("Check bounds", MAX_HELDOUT_ERROR_MM="0.01") == {"Check bounds": 1}
    assert runner("Correct all programs", MAX_CORRECTION_MM="0.01") == {"Correct all programs": 1}
    assert runner("Correct all programs", ROBOT="ur10") == {"Correct all programs": 2}


@pytest.mark.slow
def test_programs_outside_the_calibrated_region_turn_it_red(runner, tmp_path, capfd):
    """There nobody knows what to expect, however exactly the joints are solved."""
    (tmp_path / "programs").mkdir()
    turned = "def far():\n  movej([6.2, -1.6, 1.7, -1.65, -1.55, 0.1])\nend\n"
    (tmp_path / "programs" / "far.script").write_text(turned)
    assert runner("Correct all programs", CELL="none") == {"Correct all programs": 0}
    assert runner("Check bounds") == {"Check bounds": 1}
    assert "100% of 1 targets" in capfd.readouterr().out


def test_a_program_that_is_refused_turns_it_red(runner, tmp_path, capfd):
    (tmp_path / "programs").mkdir()
    (tmp_path / "programs" / "far.script").write_text(OUT_OF_REACH)
    assert runner() == {"Correct all programs": 1, "Check bounds": 0, "Previews": 0}
    assert "::warning::no preview of programs/far.script" in capfd.readouterr().out
