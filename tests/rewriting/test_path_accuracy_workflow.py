"""The workflow that shows where the tool of a corrected program really goes."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

WORKFLOW = Path(__file__).parents[2] / "workflows" / "path_accuracy.py"


def run(folder, *arguments):
    file = folder / "figures.json"
    few = ["--robots", "1", "--poses", "200", "--targets", "500", "--lines", "4", "--arcs", "2", "--json", str(file)]
    done = subprocess.run(
        [sys.executable, str(WORKFLOW), *few, *arguments], capture_output=True, text=True, check=False
    )
    return done, json.loads(file.read_text())


@pytest.mark.slow
def test_it_prints_a_table_and_writes_json(tmp_path):
    done, content = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert content["passed"] is True
    (robot,) = content["robots"]
    assert robot["effects"] == ["joint_compliance", "transmission_error"]
    assert len(robot["figures"]) == 14
    for figure in robot["figures"]:
        assert figure["what"] in done.stdout
        assert figure["passed"] == (figure["value"] <= figure["limit"])


@pytest.mark.slow
def test_its_exit_code_tells_what_is_missed(tmp_path):
    """Within a tenth of a micrometre no blend leaves the tool on its line."""
    done, content = run(tmp_path, "--poses", "60", "--tolerance-mm", "0.0001")
    assert done.returncode == 1
    assert content["passed"] is False
    assert "missed" in done.stdout
