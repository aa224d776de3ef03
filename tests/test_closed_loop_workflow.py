"""The loop on a virtual controller: every command of it works on what the one before has written."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SCRIPT = ROOT / "workflows" / "closed_loop.py"
PROGRAM = """def seam():
  set_tcp(p[0.08, 0, 0.16, 0, 0, 0])
  set_payload(0.86, [0.05, 0, 0.037])
  movej([0, d2r(-90), d2r(90), d2r(-90), d2r(-90), 0], a=1.4, v=1.05)
  movel(p[-0.525, -0.15, 0.163, -2.221441469, -2.221441469, 0], a=1.2, v=0.25)
  movel(p[-0.525, -0.15, 0.113, -2.221441469, -2.221441469, 0], a=1.2, v=0.25)
  movel(p[-0.675, -0.15, 0.113, -2.221441469, -2.221441469, 0], a=0.5, v=0.1)
  movel(p[-0.675, -0.15, 0.163, -2.221441469, -2.221441469, 0], a=0.5, v=0.25)
end
"""


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    """The finished process and the folder of its results."""
    folder = tmp_path_factory.mktemp("loop")
    (folder / "seam.script").write_text(PROGRAM)
    command = [sys.executable, SCRIPT, "-o", folder / "out", "--program", folder / "seam.script", "--poses", "40"]
    done = subprocess.run(
        [*command, "--address", "127.0.4.9", "--speed-up", "20"],
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert done.returncode in (0, 1), done.stdout + done.stderr
    return done, folder / "out"


def test_the_hidden_cause_is_named_and_the_corrected_program_arrives(loop):
    done, folder = loop
    said = json.loads((folder / "loop.json").read_text())
    assert said["named"] == said["hidden"] == ["joint_compliance"]
    assert said["as_programmed"]["true_mm"]["mean"] > 1
    assert said["as_corrected"]["true_mm"]["max"] < 0.03
    assert said["good"] == (done.returncode == 0) == (said["achieved_over_noise"] <= 1.2)
    assert said["achieved_over_noise"] < 1.6


def test_it_is_done_by_commands_that_can_be_typed(loop):
    typed = [line.split()[2] for line in loop[0].stdout.splitlines() if line.startswith("$ truepath ")]
    assert typed == ["plan", "record", "diagnose", "record", "correct", "preview", "deploy", "record"]


def test_what_was_measured_and_written_lies_in_one_folder(loop):
    names = {path.name for path in loop[1].iterdir()}
    assert names >= {"plan.csv", "measured.csv", "report.html", "preview.html", "corrected.script", "run.csv"}


def test_bad_input_gives_one_message_and_exit_code_2(tmp_path):
    command = [sys.executable, SCRIPT, "-o", tmp_path, "--address", "192.168.0.1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 2
    assert "loopback" in done.stderr
