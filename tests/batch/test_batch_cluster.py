"""Several workers: all is done once, whoever dies; a cluster that sees another disk; an interruption."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from small_programs import SCRIPT, program
from truepath.batch import results
from truepath.batch.hands import DaskHands, local_hands
from truepath.batch.run import Batch
from truepath.batch.settings import Settings
from truepath.batch.summary import summarise
from truepath.batch.tasks import make_tasks, wishes_in_folder
from truepath.files import write_atomically
from truepath.rewriting import note

pytest.importorskip("distributed", reason="needs the extra 'batch'")


def made(folder, count):
    folder.mkdir()
    for seed in range(count):
        (folder / f"p{seed:04d}.script").write_text(program(seed))
    return folder


@pytest.fixture
def written(monkeypatch):
    """How often each file was written, counted where files are written."""
    count = Counter()

    def counting(path, content):
        count[Path(path).name] += 1
        write_atomically(path, content)

    for module in (results, note):  # a program is written together with the note that it may need
        monkeypatch.setattr(module, "write_atomically", counting)
    return count


def all_done_though_a_worker_is_killed(tmp_path, calibration, written, count):
    """Kills one of two workers at a third of the way; returns the summary."""
    folder, output = made(tmp_path / "programs", count), tmp_path / "corrected"
    tasks = make_tasks(wishes_in_folder(folder, calibration, Settings()), output)
    batch = Batch(tasks)
    workers, killed, after = set(), [], Counter()

    def kill_one(result):
        pid = int(result.worker.rsplit(":", 1)[1])
        if killed:
            after[pid] += 1
        else:
            workers.add(pid)
            if len(batch.results) >= count // 3 and len(workers) == 2:
                killed.append(pid)
                os.kill(pid, signal.SIGKILL)

    with local_hands(2) as hands:
        batch.run(hands, kill_one)
    summary = summarise(batch, output)
    (dead,) = killed
    # What the dead worker had handed in before counts; the rest of its work was done by others.
    assert sum(after.values()) - after[dead] >= count // 3
    names = [f"p{seed:04d}.script" for seed in range(count)]
    assert sorted(path.name for path in output.iterdir()) == sorted([*names, *(f"{name}.json" for name in names)])
    assert written == Counter([*names, *(f"{name}.json" for name in names)])  # none lost, none twice
    assert summary["totals"]["corrected"] == count
    assert {each["writes"] for each in summary["programs"]} == {1}
    for name in names:
        content = (output / name).read_text()
        assert f"weld_{int(name[1:5])}()" in content  # nothing mixed up
        assert content.startswith("# truepath-corrected")
    return summary


def test_60_programs_two_workers_one_killed_midway(tmp_path, calibration, written):
    all_done_though_a_worker_is_killed(tmp_path, calibration, written, 60)


@pytest.mark.slow
def test_1000_programs_two_workers_one_killed_midway(tmp_path, calibration, written):
    summary = all_done_though_a_worker_is_killed(tmp_path, calibration, written, 1000)
    print(f"1000 programs in {summary['seconds']:.1f} s, one of two workers killed midway")


def test_a_program_that_kills_its_workers_is_told_and_takes_no_other_with_it(tmp_path, calibration, written):
    from deadly import POISON, DeadlyHands

    folder, output = made(tmp_path / "programs", 32), tmp_path / "corrected"
    (folder / "p0005.script").write_text(POISON + program(5))
    tasks = make_tasks(wishes_in_folder(folder, calibration, Settings()), output)
    batch = Batch(tasks)
    with local_hands(2) as hands:
        assert isinstance(hands, DaskHands)
        batch.run(DeadlyHands(hands.client))
    summary = summarise(batch, output)
    statuses = {Path(each["program"]).stem: each["status"] for each in summary["programs"]}
    assert statuses.pop("p0005") == "failed"
    assert set(statuses.values()) == {"corrected"}
    assert "every worker that took this program died" in summary["programs"][5]["message"]
    assert summary["programs"][5]["attempts"] == 2
    assert not (output / "p0005.script").exists()
    assert set(written.values()) == {1}


def test_workers_that_see_another_disk(tmp_path, calibration, batch, monkeypatch):
    """The worker lives in another folder, and files are named from the client's."""
    from distributed import LocalCluster

    made(tmp_path / "programs", 3)
    (tmp_path / "calibration.json").write_bytes(calibration.read_bytes())
    monkeypatch.chdir(tmp_path)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    with LocalCluster(n_workers=0, dashboard_address="127.0.0.1:0", silence_logs="CRITICAL") as cluster:
        address = cluster.scheduler_address
        worker = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"],
            cwd=elsewhere,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            done = batch("programs", "-c", "calibration.json", "--scheduler", address, workers=None)
        finally:
            worker.terminate()
            worker.wait(30)
    assert done.code == 0, done.err
    assert done.summary["totals"]["corrected"] == 3
    assert {each["worker"].rsplit(":", 1)[1] for each in done.summary["programs"]} != {str(os.getpid())}
    assert not list(elsewhere.rglob("*.script"))
    assert {path.name for path in (tmp_path / "corrected").glob("*.script")} == {f"p000{k}.script" for k in range(3)}


def test_a_scheduler_that_is_not_there(batch, programs, calibration, monkeypatch):
    from truepath.batch import hands

    monkeypatch.setattr(hands, "ANSWER_S", 1)
    done = batch(programs(a=1), "-c", calibration, "--scheduler", "tcp://127.0.0.1:9", workers=None)
    assert done.code == 2
    assert "no scheduler answers" in done.err
    assert "Traceback" not in done.err


def test_an_interruption_keeps_what_is_done_and_the_same_command_goes_on(tmp_path, calibration):
    folder, output = made(tmp_path / "programs", 150), tmp_path / "corrected"
    command = [sys.executable, SCRIPT, folder, "-c", calibration, "-o", output, "--workers", "2"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    while not list(output.glob("*.script.json")) and process.poll() is None:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all of them
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, out + err
    assert "the same command goes on" in err
    assert "Traceback" not in err
    summary = json.loads((output / "batch.json").read_text())
    done = summary["totals"]["corrected"]
    assert summary["complete"] is False
    assert 0 < done < 150
    assert summary["totals"]["pending"] == 150 - done
    told = list(output.glob("*.script.json"))
    before = {path: path.stat().st_mtime_ns for name in told for path in (name, name.with_suffix(""))}
    assert len(told) == done
    assert not list(output.glob(".*"))  # nothing half written
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert again.returncode == 0, again.stderr
    assert re.search(rf"150 programs \({done} of them done before\): 150 corrected", again.stdout)
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert len(list(output.glob("*.script"))) == 150
