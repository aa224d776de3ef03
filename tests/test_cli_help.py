"""The command line before it does anything: help, a quick start, and how wrong usage exits."""

import subprocess
import sys
from pathlib import Path

import pytest
from truepath.cli import app
from typer.main import get_command

COMMANDS = ("calibrate", "diagnose", "validate", "correct", "preview", "export", "simulate", "demo")


HEAVY = ("numpy", "scipy", "torch", "pydrake", "casadi", "pydantic", "yourdfpy", "meshcat")


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
