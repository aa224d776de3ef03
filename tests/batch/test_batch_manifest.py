"""Manifests: each program with its own calibration, place and options; every fault with its line and column."""

import json

import pytest
from small_programs import program


@pytest.fixture
def manifest(programs, calibration, other_calibration, tmp_path):
    """Function: writes a manifest beside three programs and two calibrations."""
    programs(a=1, b=2, c=3)
    (tmp_path / "one.json").write_bytes(calibration.read_bytes())
    (tmp_path / "two.json").write_bytes(other_calibration.read_bytes())

    def manifest(text, name="manifest.csv"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return manifest


def test_each_program_has_its_own_calibration_place_and_options(batch, manifest, truepath, tmp_path):
    path = manifest(
        "program,calibration,output,as,max_correction_mm,start_deg\n"
        'programs/a.script,one.json,cell1/weld.script,poses,,"0,-90,90,-90,-90,0"\n'
        "programs/a.script,two.json,cell2/weld.script,,4,\n"
        "programs/b.script,one.json,b.script,joints,0.01,\n"
    )
    done = batch(path)
    assert done.code == 1
    assert [each["status"] for each in done.summary["programs"]] == ["corrected", "corrected", "refused"]
    for calibration, output, options in (
        ("one.json", "cell1/weld.script", ("--as", "poses", "--start-deg", "0,-90,90,-90,-90,0")),
        ("two.json", "cell2/weld.script", ()),
    ):
        alone = tmp_path / "alone.script"
        command = ("correct", tmp_path / "programs/a.script", "-c", tmp_path / calibration, "-o", alone, *options)
        assert truepath(*command).code == 0
        assert (done.folder / output).read_bytes() == alone.read_bytes()
    assert b"p[" in (done.folder / "cell1/weld.script").read_bytes()


def test_json_lines_say_the_same(batch, manifest, tmp_path):
    rows = [
        {"program": "programs/a.script", "calibration": "one.json", "output": "a.script", "as": "poses", "tcp": None},
        {"program": "programs/b.script", "output": "x/b.script", "start_deg": [0, -90, 90, -90.5, -90, 0]},
    ]
    path = manifest("\n".join(map(json.dumps, rows)) + "\n\n", "manifest.jsonl")
    done = batch(path, "--calibration", tmp_path / "two.json")
    assert done.code == 0, done.err
    assert [each["calibration"] for each in done.summary["programs"]] == [
        str(tmp_path / "one.json"),
        str(tmp_path / "two.json"),
    ]
    assert batch(path, "--calibration", tmp_path / "two.json").summary["totals"]["resumed"] == 2


def test_options_of_the_command_count_where_a_cell_is_empty(batch, manifest):
    path = manifest(
        "program,calibration,output,max_correction_mm\n"
        "programs/a.script,one.json,a.script,\nprograms/b.script,one.json,b.script,4\n"
    )
    done = batch(path, "--max-correction-mm", 0.01)
    assert [each["status"] for each in done.summary["programs"]] == ["refused", "corrected"]


GOOD = "programs/a.script,one.json,a.script"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("program,calibration,output\n", ("header but no rows",)),
        ("program,calibration\nprograms/a.script,one.json\n", ("line 1", "'output'", "missing")),
        (f"program,calibration,output,colour\n{GOOD},red\n", ("line 1", "'colour'", "unknown column")),
        (f"program,calibration,output\n{GOOD}\nprograms/b.script,,b.script\n", ("line 3", "'calibration'", "missing")),
        (f"program,calibration,output\n{GOOD}\nprograms/z.script,one.json,z.script\n", ("line 3", "'program'")),
        (f"program,calibration,output\n{GOOD}\nprograms,one.json,z.script\n", ("line 3", "'program'")),
        (f"program,calibration,output\n{GOOD}\none.json,one.json,z.script\n", ("line 3", "unknown kind of program")),
        (f"program,calibration,output\n{GOOD}\nprograms/b.script,none.json,b.script\n", ("line 3", "none.json")),
        (f"program,calibration,output\n{GOOD}\nprograms/b.script,manifest.csv,b.script\n", ("line 3", "no JSON")),
        (f"program,calibration,output,as\n{GOOD},pose\n", ("line 2", "'as'", "'joints' or 'poses'")),
        (f"program,calibration,output,max_correction_mm\n{GOOD},1_0\n", ("line 2", "'max_correction_mm'")),
        (f"program,calibration,output,max_correction_mm\n{GOOD},nan\n", ("line 2", "'max_correction_mm'")),
        (f"program,calibration,output,max_correction_mm\n{GOOD},-1\n", ("line 2", "'max_correction_mm'")),
        (f"program,calibration,output,payload_kg\n{GOOD},heavy\n", ("line 2", "'payload_kg'")),
        (f'program,calibration,output,tcp\n{GOOD},"1,2"\n', ("line 2", "--tcp")),
        (f"program,calibration,output,cell\n{GOOD},no_cell\n", ("line 2", "no_cell")),
        (f"program,calibration,output\n{GOOD},\n", ("line 2", "cells")),
    ],
)
def test_faults_are_told_with_line_and_column_and_nothing_is_started(batch, manifest, text, words):
    done = batch(manifest(text))
    assert done.code == 2
    assert "manifest.csv" in done.err
    assert "Traceback" not in done.err
    for word in words:
        assert word in done.err
    assert not done.folder.exists()


@pytest.mark.parametrize(
    ("second", "words"),
    [
        ("a.script", "two results would be one file"),
        ("./x/../a.script", "no place in the output folder"),
        ("./a.script", "two results would be one file"),
        ("a.script.json", "two results would be one file"),  # where the first one's result goes
        ("batch.json", "two results would be one file"),
        ("a.script/b.script", "a file stands where a folder is needed"),
        ("../b.script", "no place in the output folder"),
        ("/tmp/b.script", "no place in the output folder"),
        (".", "no place in the output folder"),
    ],
)
def test_no_two_tasks_write_one_file_and_none_leaves_the_folder(batch, manifest, second, words):
    text = f"program,calibration,output\n{GOOD}\nprograms/b.script,one.json,{second}\n"
    done = batch(manifest(text))
    assert done.code == 2
    assert words in done.err
    assert "line 3, column 'output'" in done.err
    assert not done.folder.exists()


@pytest.mark.parametrize("output", ["programs/a.script", "manifest.csv", "one.json"])
def test_no_input_is_written_over(batch, manifest, tmp_path, output):
    done = batch(manifest(f"program,calibration,output\nprograms/a.script,one.json,{output}\n"), "--output", tmp_path)
    assert done.code == 2
    assert "the output is an input" in done.err
    assert (tmp_path / "programs" / "a.script").read_text() == program(1)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("{", ("line 2", "no JSON")),
        ("[1]", ("line 2", "no object")),
        ('{"program": "programs/b.script", "program": "x"}', ("line 2", "twice")),
        ('{"program": 3, "calibration": "one.json", "output": "b.script"}', ("line 2", "'program'", "string")),
        (
            '{"program": "programs/b.script", "calibration": "one.json", "output": "b.script", "payload_kg": true}',
            ("line 2", "'payload_kg'"),
        ),
        (
            '{"program": "programs/b.script", "calibration": "one.json", "output": "b.script", "payload_kg": "1"}',
            ("line 2", "'payload_kg'"),
        ),
        ("[" * 100_000, ("line 2", "no JSON")),
    ],
)
def test_faults_in_json_lines(batch, manifest, line, words):
    first = '{"program": "programs/a.script", "calibration": "one.json", "output": "a.script"}'
    done = batch(manifest(f"{first}\n{line}\n", "manifest.jsonl"))
    assert done.code == 2
    for word in words:
        assert word in done.err
    assert not done.folder.exists()


def test_a_file_that_is_no_manifest(batch, manifest):
    done = batch(manifest("x", "manifest.txt"))
    assert done.code == 2
    assert "neither a folder nor a manifest" in done.err
