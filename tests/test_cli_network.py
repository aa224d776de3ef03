"""``calibrate --residual network``: what it writes and says, what it refuses, and that Ctrl-C loses nothing."""

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest
from command import is_refused
from drake_arm import DrakeArm
from truepath.calibration import load_calibration
from truepath.measurements import Measurements
from truepath.residual.checkpoint import Checkpoint
from truepath.residual.options import Options
from truepath.virtual.simulate import to_csv

CENTRE = np.array([0.2, -1.2, 1.1, -0.7, 0.9, 0.3])
PLAIN = ("--robot", "ur5", "--effects", "none")
NETWORK = (*PLAIN, "--residual", "network")


def campaign(count, stray_m):
    """CSV of a UR5 whose probe strays as a smooth function of several joints."""
    q = CENTRE + np.random.default_rng(1).uniform(-1, 1, (count, 6))
    measured = DrakeArm("ur5", seed=3).measure(q, [0.03, -0.02, 0.05], 0.02, seed=2)
    a, b, c = q[:, :3].T
    stray = stray_m * np.stack([np.sin(2 * a + 2 * c), np.cos(2 * b - 1.5 * c), np.sin(2 * b + a)], axis=1)
    return to_csv(Measurements(q, measured.p_ME + stray))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("data")


@pytest.fixture(scope="module")
def odd(folder):
    """Data with something to learn."""
    path = folder / "odd.csv"
    path.write_text(campaign(120, 2e-4))
    return path


@pytest.fixture(scope="module")
def plain(folder):
    """Data with noise alone."""
    path = folder / "plain.csv"
    path.write_text(campaign(70, 0.0))
    return path


# Networks that learn in a moment, in this process and in others.
QUICK = """
from truepath.residual import options
from truepath.residual.limits import Limits, Settings
plain = options.Options.__init__
def quick(self, **given):
    evolution = Settings(individuals=6, smallest=6, largest=10, generations={generations})
    plain(self, **({{"evolution": evolution, "limits": Limits(30, 10), "members": 2}} | given))
options.Options.__init__ = quick
"""
GENERATIONS, MANY_GENERATIONS = 3, 60
MAIN = "import sys; sys.argv[0] = 'truepath'; from truepath.cli import main; main()"


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Networks that learn in a moment."""
    monkeypatch.setattr(Options, "__init__", Options.__init__)  # so that it is put back
    exec(QUICK.format(generations=GENERATIONS), {})


def without_moment(path):
    """Content of a calibration file but for when it was written."""
    content = json.loads(path.read_text())
    return {name: value for name, value in content.items() if name not in ("created_utc", "checksum")}


# In and out


def test_networks_that_are_proved_enter_the_file_and_the_command_says_so(truepath, odd, tmp_path):
    outcome = truepath("calibrate", odd, *NETWORK, "-o", tmp_path / "c.json")
    assert outcome.code == 0, outcome.err
    assert "neural residual: in the model: " in outcome.out
    assert load_calibration(tmp_path / "c.json").residual is not None
    assert [path.name for path in tmp_path.iterdir()] == ["c.json"]


def test_networks_that_are_not_are_left_out_and_the_command_says_why(truepath, plain, tmp_path):
    outcome = truepath("calibrate", plain, *NETWORK, "-o", tmp_path / "c.json")
    assert outcome.code == 0, outcome.err
    assert "neural residual: left out: " in outcome.out
    assert load_calibration(tmp_path / "c.json").residual is None


def test_where_nobody_asks_nothing_is_said_of_networks(truepath, plain, tmp_path):
    outcome = truepath("calibrate", plain, *PLAIN, "-o", tmp_path / "c.json")
    assert outcome.code == 0, outcome.err
    assert "neural" not in outcome.out
    outcome = truepath("calibrate", plain, *PLAIN, "--json", "-o", tmp_path / "c.json")
    assert outcome.json()["network"] is None


@pytest.mark.parametrize("effects", ["none", "auto"])
@pytest.mark.parametrize(("name", "begins"), [("odd", "in the model"), ("plain", "left out")])
def test_json_says_what_became_of_the_networks(truepath, request, tmp_path, effects, name, begins):
    data = request.getfixturevalue(name)
    options = ("--robot", "ur5", "--effects", effects, "--residual", "network", "--json")
    outcome = truepath("calibrate", data, *options, "-o", tmp_path / "c.json")
    assert outcome.code == 0, outcome.err
    assert outcome.json()["network"].startswith(begins)


@pytest.mark.parametrize("effects", ["none", "auto"])
def test_with_too_few_poses_the_command_says_that_nothing_was_learnt(truepath, odd, tmp_path, effects):
    few = tmp_path / "few.csv"
    few.write_text("".join(odd.read_text().splitlines(keepends=True)[:13]))
    options = ("--robot", "ur5", "--effects", effects, "--residual", "network")
    outcome = truepath("calibrate", few, *options, "-o", tmp_path / "c.json")
    assert outcome.code == 0, outcome.err
    assert "neural residual: left out: there are too few poses" in outcome.out


def test_the_same_seed_writes_the_same_file_another_seed_other_networks(truepath, odd, tmp_path):
    for name, seed in (("one", 5), ("again", 5), ("other", 6)):
        assert truepath("calibrate", odd, *NETWORK, "--seed", seed, "-o", tmp_path / f"{name}.json").code == 0
    one, again, other = (without_moment(tmp_path / f"{name}.json") for name in ("one", "again", "other"))
    assert one == again
    assert one["residual"]["networks"] != other["residual"]["networks"]
    assert one["parameters"] == other["parameters"]


# Refusals


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--residual", "forest"), ("unknown residual 'forest'", "none or network")),
        (("--checkpoint", "new.json"), ("--residual network",)),
        (("--device", "cuda"), ("--residual network",)),
        (("--residual", "network", "--device", "tpu"), ("unknown device 'tpu'",)),
        (("--residual", "network", "--device", "cuda"), ("there is no CUDA device here", "--device cpu")),
    ],
    ids=lambda value: " ".join(value),
)
def test_wrong_options_are_refused_and_what_is_there_stays(truepath, odd, tmp_path, monkeypatch, options, words):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    monkeypatch.chdir(tmp_path)
    target = tmp_path / "c.json"
    target.write_text("keep")
    assert is_refused(truepath("calibrate", odd, *PLAIN, *options, "-o", target), *words)
    assert target.read_text() == "keep"
    assert [path.name for path in tmp_path.iterdir()] == ["c.json"]


def test_a_seed_without_networks_is_refused(truepath, odd, tmp_path):
    result = truepath("calibrate", odd, *PLAIN, "--seed", 5, "-o", tmp_path / "c.json")
    assert result.code == 2
    assert "--residual network" in result.err


def test_a_place_that_is_not_there_is_refused_before_the_work(truepath, odd, tmp_path):
    result = truepath("calibrate", odd, *NETWORK, "-o", tmp_path / "nowhere" / "c.json")
    assert result.code == 2
    assert "the output cannot be written" in result.err


def test_a_negative_seed_is_refused(truepath, odd, tmp_path):
    assert truepath("calibrate", odd, *NETWORK, "--seed", -1, "-o", tmp_path / "c.json").code == 2
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_no_checkpoint_is_refused_and_stays(truepath, odd, tmp_path):
    mine, target = tmp_path / "mine.json", tmp_path / "c.json"
    mine.write_text('{"shopping": ["milk"]}')
    assert is_refused(truepath("calibrate", odd, *NETWORK, "--checkpoint", mine, "-o", target), "mine.json")
    assert mine.read_text() == '{"shopping": ["milk"]}'
    assert not target.exists()


@pytest.mark.parametrize("there", [True, False], ids=["of an earlier run", "new"])
def test_the_checkpoint_cannot_be_the_result(truepath, odd, tmp_path, there):
    """When all is done the checkpoint is deleted: the calibration would be."""
    target = tmp_path / "c.json"
    if there:
        assert truepath("calibrate", odd, *PLAIN, "-o", target).code == 0
    before = target.read_bytes() if there else None
    same = tmp_path / "sub" / ".." / "c.json"
    (tmp_path / "sub").mkdir()
    for checkpoint in (target, same):
        assert is_refused(truepath("calibrate", odd, *NETWORK, "--checkpoint", checkpoint, "-o", target), "c.json")
    assert (target.read_bytes() if target.exists() else None) == before


def test_the_checkpoint_cannot_be_the_data(truepath, odd, tmp_path):
    before = odd.read_bytes()
    assert is_refused(truepath("calibrate", odd, *NETWORK, "--checkpoint", odd, "-o", tmp_path / "c.json"), "odd.csv")
    assert odd.read_bytes() == before


@pytest.mark.parametrize("name", ["calibration.json", "diagnosis.json", "report.html", "poses.csv"])
def test_the_checkpoint_of_a_diagnosis_cannot_be_one_of_its_results(truepath, plain, tmp_path, name):
    options = ("--robot", "ur5", "--residual", "network", "--checkpoint", tmp_path / name)
    assert is_refused(truepath("diagnose", plain, *options, "-o", tmp_path), name)
    assert list(tmp_path.iterdir()) == []


def test_a_checkpoint_where_nothing_can_be_written_is_refused(truepath, odd, tmp_path):
    nowhere = tmp_path / "nowhere" / "checkpoint.json"
    assert is_refused(
        truepath("calibrate", odd, *NETWORK, "--checkpoint", nowhere, "-o", tmp_path / "c.json"), "nowhere"
    )
    assert list(tmp_path.iterdir()) == []


# Checkpoints


def test_a_checkpoint_is_gone_when_all_is_done(truepath, odd, tmp_path):
    kept = tmp_path / "checkpoint.json"
    outcome = truepath("calibrate", odd, *NETWORK, "--checkpoint", kept, "-o", tmp_path / "c.json")
    assert outcome.code == 0, outcome.err
    assert [path.name for path in tmp_path.iterdir()] == ["c.json"]


def test_ctrl_c_leaves_a_checkpoint_and_no_calibration_and_the_same_command_then_ends_as_if_nothing_had_been(
    truepath, odd, tmp_path
):
    kept, target, undisturbed = (tmp_path / name for name in ("checkpoint.json", "c.json", "undisturbed.json"))
    program = QUICK.format(generations=MANY_GENERATIONS) + MAIN
    command = [sys.executable, "-c", program, "calibrate", odd, *NETWORK]
    quiet = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "env": {**os.environ, "OMP_NUM_THREADS": "1"}}
    # Where the tests run in the background of a shell, it has told them to ignore Ctrl-C, and they would pass that on.
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen([*command, "--checkpoint", kept, "-o", target], **quiet, preexec_fn=heard)
    try:
        deadline = time.monotonic() + 60
        while not kept.exists() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        assert process.poll() is None, process.communicate()
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130, err.decode()
    assert b"Traceback" not in err
    assert b"the same command goes on from" in err
    assert [path.name for path in tmp_path.iterdir()] == ["checkpoint.json"]
    content = json.loads(kept.read_text())
    assert content["finished"] or content["under_way"]
    assert Checkpoint(kept).path == kept
    subprocess.run([*command, "--checkpoint", kept, "-o", target], check=True, timeout=200, **quiet)
    assert not kept.exists()
    exec(QUICK.format(generations=MANY_GENERATIONS), {})
    assert truepath("calibrate", odd, *NETWORK, "-o", undisturbed).code == 0
    assert without_moment(target) == without_moment(undisturbed)
    assert without_moment(target)["residual"] is not None
