"""The workflow that reads a controller for minutes, for a few seconds."""

import importlib.util
import json
from pathlib import Path

import pytest
from ur_client import free_address

WORKFLOW = Path(__file__).parents[3] / "workflows" / "rtde_readback.py"


@pytest.fixture
def workflow():
    spec = importlib.util.spec_from_file_location("rtde_readback", WORKFLOW)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_unmodified_client_reads_a_moving_robot_in_flat_memory(workflow, tmp_path, capsys):
    figures = tmp_path / "figures.json"
    code = workflow.main(["--minutes", "0.05", "--address", free_address(), "--json", str(figures)])
    told = json.loads(figures.read_text())
    # ur_rtde drops what it finds too late; beside other tests that happens, and the workflow must say so.
    assert told["seconds"] > 1.0
    assert told["samples"] + told["lost"] == pytest.approx(125 * told["seconds"] + 1, abs=0.5)
    assert told["moved_rad"] > 0.1
    assert told["controller_log"] == []
    assert all(workflow._is_flat(*told[name]) for name in ("reader_mb", "controller_mb"))
    assert code == (0 if told["passed"] else 1)
    assert f"{told['lost']} lost" in capsys.readouterr().out


def test_a_lost_sample_or_growing_memory_is_a_missed_bound(workflow, monkeypatch, capsys):
    good = {"samples": 75000, "seconds": 600.0, "lost": 0, "moved_rad": 0.6, "controller_load": 0.1, "passed": False}
    good |= {"reader_mb": (20.0, 20.1), "controller_mb": (150.0, 190.0)}
    monkeypatch.setattr(workflow, "measured", lambda *_: good)
    assert workflow.main([]) == 1
    assert "missed" in capsys.readouterr().out
    assert not workflow._is_flat(150.0, 190.0)
    assert workflow._is_flat(150.0, 152.0)
