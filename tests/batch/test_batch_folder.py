"""A folder of programs: what is written, what is done again, what is refused. One process, no Dask."""

import json
import os
import sys

import pytest
from small_programs import BY_SENSOR, NOTHING_MOVES, OUT_OF_REACH, program, workflow


def contents(folder):
    """Bytes of all files by their place, those of the summary left out, which tells the time."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("batch."))
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_every_program_is_corrected_as_the_command_does_it(batch, programs, calibration, truepath, tmp_path):
    folder = programs(a=1, cell__b=2, cell__deep__c=3)
    (folder / "path.csv").write_text("q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,note\n0,-1.6,1.7,-1.6,-1.5,0.1,x\n")
    (folder / "notes.txt").write_text("no program")
    done = batch(folder, "-c", calibration, "--max-correction-mm", 4)
    assert done.code == 0, done.err
    written = contents(done.folder)
    names = {"a.script", "cell/b.script", "cell/deep/c.script", "path.csv"}
    assert set(written) == names | {f"{name}.json" for name in names} | {"path.csv.truepath.json"}
    for name in names:
        alone = tmp_path / f"alone{name[-7:].replace('/', '')}"
        assert truepath("correct", folder / name, "-c", calibration, "-o", alone).code == 0
        assert written[name] == alone.read_bytes() != (folder / name).read_bytes()
    totals = done.summary["totals"]
    assert (totals["programs"], totals["corrected"], totals["targets"]) == (4, 4, 10)
    assert done.summary["complete"] is True


def test_a_toolpath_that_is_corrected_already_is_refused(batch, programs, calibration):
    folder = programs()
    folder.mkdir(exist_ok=True)
    (folder / "path.csv").write_text("q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad\n0,-1.6,1.7,-1.6,-1.5,0.1\n")
    first = batch(folder, "-c", calibration)
    first.folder.rename(folder.with_name("corrected_once"))
    again = batch(folder.with_name("corrected_once"), "-c", calibration)
    assert again.code == 1
    (entry,) = again.summary["programs"]
    assert entry["status"] == "refused"
    assert "path.csv: truepath has corrected this program already" in entry["message"]
    assert not (again.folder / "path.csv").exists()


def test_a_result_says_how_it_came_about(batch, programs, calibration):
    done = batch(programs(a=1), "-c", calibration)
    result = json.loads((done.folder / "a.script.json").read_text())
    assert result["schema"] == "truepath.batch-result/1"
    assert (result["status"], result["attempts"], result["summary"]["corrected"]) == ("corrected", 1, 3)
    assert result["summary"]["program"].endswith("programs/a.script")
    (entry,) = done.summary["programs"]
    assert entry["displacement_mm"]["max"] == result["summary"]["displacement_mm"]["max"] > 0.1
    assert entry["sha256"]["output"] == result["output_sha256"]
    assert (entry["output"], entry["result"], entry["writes"]) == ("a.script", "a.script.json", 1)


def test_what_is_refused_does_not_keep_the_rest_from_being_done(batch, programs, calibration):
    folder = programs(good=1, far=OUT_OF_REACH, seen=BY_SENSOR, still=NOTHING_MOVES, broken="def x(:\n  movej([\n")
    done = batch(folder, "-c", calibration)
    assert done.code == 1
    assert done.statuses() == {
        "good": "corrected",
        "far": "refused",
        "seen": "partial",
        "still": "unchanged",
        "broken": "refused",
    }
    by_name = {each["program"]: each for each in done.summary["programs"]}
    far = by_name[str(folder / "far.script")]
    assert "far.script, line 3: the target is out of reach" in far["message"]
    assert far["output"] is None
    assert "truepath-batch-" not in json.dumps(done.summary)  # where a worker had it
    assert by_name[str(folder / "seen.script")]["unresolved_lines"] == [3]
    assert {name for name in contents(done.folder) if not name.endswith(".json")} == {
        "good.script",
        "seen.script",
        "still.script",
    }
    assert (done.folder / "still.script").read_text() == NOTHING_MOVES
    assert "refused: " in done.out


def test_partial_programs_are_a_fault_unless_allowed(batch, programs, calibration):
    folder = programs(seen=BY_SENSOR)
    assert batch(folder, "-c", calibration).code == 1
    assert batch(folder, "-c", calibration, "--allow-partial").code == 0


def test_a_dry_run_keeps_nothing(batch, programs, calibration, tmp_path):
    folder = programs(a=1, far=OUT_OF_REACH)
    done = batch(folder, "-c", calibration, "--dry-run", "--json")
    assert done.code == 1
    assert not done.folder.exists()
    summary = json.loads(done.out)
    assert [each["status"] for each in summary["programs"]] == ["corrected", "refused"]
    assert {path.name for path in tmp_path.iterdir()} == {"programs"}


def test_without_a_place_for_results(programs, calibration, capsys):
    assert workflow().main([str(programs(a=1)), "-c", str(calibration)]) == 2
    assert "--output FOLDER, or --dry-run" in capsys.readouterr().err


def test_what_is_done_is_not_done_again(batch, programs, calibration):
    folder = programs(a=1, b=2, far=OUT_OF_REACH)
    first = batch(folder, "-c", calibration)
    before = {path: path.stat().st_mtime_ns for path in first.folder.glob("*.script*")}
    for path in folder.iterdir():
        os.utime(path, (2e9, 2e9))  # newer than any result: times do not count
    again = batch(folder, "-c", calibration)
    assert again.code == first.code == 1
    assert again.done_now() == set()
    assert {path: path.stat().st_mtime_ns for path in again.folder.glob("*.script*")} == before
    assert again.statuses() == first.statuses()
    assert again.summary["totals"]["resumed"] == 3
    assert again.summary["totals"]["displacement_mm"] == first.summary["totals"]["displacement_mm"]


def test_what_differs_is_done_again(batch, programs, calibration, other_calibration):
    folder = programs(a=1, b=2, c=3)
    done = batch(folder, "-c", calibration)
    (folder / "a.script").write_text(program(11))
    assert batch(folder, "-c", calibration).done_now() == {"a"}
    (done.folder / "b.script").write_text("edited by hand")
    assert batch(folder, "-c", calibration).done_now() == {"b"}
    (done.folder / "c.script").unlink()
    assert batch(folder, "-c", calibration).done_now() == {"c"}
    (done.folder / "c.script.json").write_text("{")
    assert batch(folder, "-c", calibration).done_now() == {"c"}
    assert batch(folder, "-c", calibration, "--max-correction-mm", 4).done_now() == {"a", "b", "c"}
    assert batch(folder, "-c", calibration, "--max-correction-mm", 4).done_now() == set()
    poses = batch(folder, "-c", calibration, "--as", "poses")
    assert poses.done_now() == {"a", "b", "c"}
    assert b"p[" in contents(poses.folder)["a.script"]
    assert batch(folder, "-c", other_calibration, "--as", "poses").done_now() == {"a", "b", "c"}
    assert batch(folder, "-c", other_calibration, "--as", "poses", "--force").done_now() == {"a", "b", "c"}


def test_a_bound_that_is_passed_takes_the_former_result_away(batch, programs, calibration):
    folder = programs(a=1, b=2)
    assert batch(folder, "-c", calibration).code == 0
    (folder / "a.script").write_text(OUT_OF_REACH)
    done = batch(folder, "-c", calibration)
    assert done.code == 1
    assert not (done.folder / "a.script").exists()  # nobody may take the former one for the result of this one
    assert (done.folder / "b.script").exists()
    tight = batch(folder, "-c", calibration, "--max-correction-mm", 0.01)
    assert set(tight.statuses().values()) == {"refused"}
    assert not (done.folder / "b.script").exists()


def test_what_others_wrote_stays_where_nothing_came_of_a_program(batch, programs, calibration):
    folder = programs(a=OUT_OF_REACH)
    foreign = folder.parent / "corrected" / "a.script"
    foreign.parent.mkdir()
    foreign.write_text("by hand")
    for _ in range(2):
        done = batch(folder, "-c", calibration)
        assert foreign.read_text() == "by hand"
        assert "it is not the result of this program" in done.summary["programs"][0]["message"]
        assert done.summary["programs"][0]["output"] is None


def test_results_of_programs_that_are_gone_are_told(batch, programs, calibration):
    folder = programs(a=1, b=2)
    batch(folder, "-c", calibration)
    (folder / "b.script").unlink()
    done = batch(folder, "-c", calibration)
    assert done.summary["left_over"] == ["b.script"]
    assert "from an earlier batch: b.script" in done.out


def test_a_program_may_have_any_name(batch, programs, calibration):
    folder = programs(**{"Schweißnaht № 5 <b>&": 1})
    assert batch(folder, "-c", calibration).code == 0


def test_broken_truepath_is_no_refusal_and_stops_nobody(batch, programs, calibration, monkeypatch):
    from truepath.batch import work

    rewrite = work.rewrite_program

    def breaking(file, *others):
        if b"weld_2" in file.read_bytes():
            raise ZeroDivisionError("made up")
        return rewrite(file, *others)

    monkeypatch.setattr(work, "rewrite_program", breaking)
    folder = programs(a=1, b=2, c=3)
    done = batch(folder, "-c", calibration)
    assert done.code == 1
    assert done.statuses() == {"a": "corrected", "b": "failed", "c": "corrected"}
    assert "ZeroDivisionError: made up" in done.summary["programs"][1]["message"]
    monkeypatch.undo()
    assert batch(folder, "-c", calibration).done_now() == {"b"}  # a failure is tried again


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--max-correction-mm", "0"), "--max-correction-mm"),
        (("--max-correction-mm", "nan"), "--max-correction-mm"),
        (("--path-tolerance-mm", "-1"), "--path-tolerance-mm"),
        (("--start-deg", "1,2"), "--start-deg"),
        (("--tcp", "x"), "--tcp"),
        (("--cell", "no_cell"), "no_cell"),
        (("--controller-kinematics", "absent.conf"), "absent.conf"),
        (("--robot", "ur10"), "belongs to another robot"),
        (("--workers", "0"), "--workers"),
        (("--scheduler", "tcp://localhost:1"), "exclude each other"),
    ],
)
def test_bad_options_end_before_anything_is_done(batch, programs, calibration, options, words):
    done = batch(programs(a=1), "-c", calibration, *options)
    assert done.code == 2
    assert words in done.err
    assert done.err.count("error:") == 1
    assert not done.folder.exists()


def test_a_folder_without_programs_a_missing_one_and_no_calibration(batch, programs, calibration, tmp_path):
    (tmp_path / "empty").mkdir()
    for source, options, words in (
        (tmp_path / "empty", ("-c", calibration), "there is no program"),
        (tmp_path / "absent", ("-c", calibration), "no such folder"),
        (programs(a=1), (), "--calibration FILE"),
        (programs(a=1), ("-c", tmp_path / "absent.json"), "cannot be read"),
    ):
        done = batch(source, *options)
        assert done.code == 2
        assert words in done.err
        assert not done.folder.exists()


def test_results_never_lie_among_the_programs(batch, programs, calibration):
    folder = programs(a=1)
    for place in (folder, folder / "corrected"):
        done = batch(folder, "-c", calibration, "--output", place)
        assert done.code == 2
        assert "among the programs" in done.err
    assert {path.name for path in folder.iterdir()} == {"a.script"}


def test_without_dask_one_worker_works_and_more_say_what_to_install(batch, programs, calibration, monkeypatch):
    monkeypatch.setitem(sys.modules, "dask", None)
    monkeypatch.setitem(sys.modules, "distributed", None)
    folder = programs(a=1)
    for options in (("--workers", 2), ("--scheduler", "tcp://localhost:1")):
        done = batch(folder, "-c", calibration, *options, workers=None)
        assert done.code == 2
        assert "pip install 'truepath[batch]'" in done.err
        assert not done.folder.exists()
    assert batch(folder, "-c", calibration).code == 0
