"""``truepath correct`` on CSV toolpaths: what it prints and writes, what it refuses and never overwrites."""

import pytest
from command import is_refused
from truepath import plants

WELD_PATH = plants.models_dir() / "ur5" / "weld_path.csv"
POSE_PATH = plants.models_dir() / "ur5" / "pose_path.csv"


def test_correct_keeps_every_line_and_every_other_column(truepath, calibration, tmp_path):
    truepath("correct", WELD_PATH, "-c", calibration, "-o", tmp_path / "weld.csv")
    before, after = (path.read_text().splitlines() for path in (WELD_PATH, tmp_path / "weld.csv"))
    assert len(after) == len(before)
    assert after[0] == before[0]
    for old, new in zip(before[1:], after[1:], strict=True):
        assert (old.split(",")[0], old.split(",")[-1]) == (new.split(",")[0], new.split(",")[-1])


def test_correct_prints_json_for_machines(truepath, calibration, tmp_path):
    outcome = truepath("correct", POSE_PATH, "-c", calibration, "-o", tmp_path / "poses.csv", "--json")
    content = outcome.json()
    assert outcome.code == 0
    assert (content["schema"], content["waypoints"]) == ("truepath.correction/1", 60)
    assert content["output"] == str(tmp_path / "poses.csv")
    assert content["predicted_error_after_mm"]["max"] < 1e-3


def test_its_own_work_is_not_corrected_twice_by_the_note_beside_it(truepath, calibration, tmp_path):
    first = tmp_path / "wp.csv"
    outcome = truepath("correct", WELD_PATH, "-c", calibration, "-o", first)
    assert "weld_path.csv is taken for the original: a CSV without its note cannot be recognised" in outcome.out
    assert f"written to {first}, with its note wp.csv.truepath.json" in outcome.out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["wp.csv", "wp.csv.truepath.json"]
    for command in ("correct", "preview"):
        again = truepath(command, first, "-c", calibration, "-o", tmp_path / "wp2.csv")
        assert is_refused(again, "wp.csv: truepath has corrected this program already", "the program as it was before")
    assert not (tmp_path / "wp2.csv").exists()


def test_json_names_the_note(truepath, calibration, tmp_path):
    options = ("correct", WELD_PATH, "-c", calibration, "-o", tmp_path / "wp.csv", "--json")
    assert truepath(*options, "--dry-run").json()["note"] is None
    note = truepath(*options).json()["note"]
    assert note == str((tmp_path / "wp.csv.truepath.json").resolve())


@pytest.mark.parametrize("options", [(), ("--as", "poses"), ("--as", "poses", "--start-deg=0,-90,90,-90,-90,0")])
def test_a_path_that_ends_in_the_middle_of_a_number_is_told(truepath, calibration, tmp_path, options):
    lines = POSE_PATH.read_text().splitlines()[:20]
    for end, is_told in (("\n", False), ("", True)):
        (tmp_path / "cut.csv").write_text("\n".join(lines) + end)
        outcome = truepath("correct", tmp_path / "cut.csv", "-c", calibration, "--dry-run", *options)
        told = "warning: cut-off in line 20: the last line has no line end: was the file cut off?" in outcome.out
        assert (outcome.code, told) == (0, is_told)
        assert outcome.err == ""


def test_where_most_targets_collide_it_asks_whether_the_path_is_for_another_robot(truepath, calibration, tmp_path):
    lines = (plants.models_dir() / "ur10" / "weld_path.csv").read_text().splitlines(keepends=True)
    (tmp_path / "ur10.csv").write_text("".join([lines[0], *lines[1::10]]))
    options = ("-c", calibration, "--dry-run")
    for path, is_asked in ((tmp_path / "ur10.csv", True), (WELD_PATH, False)):
        out = truepath("correct", path, *options).out
        assert ("does not change that; is it a program for another robot?" in out) is is_asked
        assert ("the program itself drives" in out) is is_asked


def spoiled(tmp_path, line, change):
    """The weld path with one waypoint changed."""
    lines = WELD_PATH.read_text().splitlines()
    cells = lines[line - 1].split(",")
    lines[line - 1] = ",".join(change(cells))
    path = tmp_path / "spoiled.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda cells: [cells[0], "6.3", *cells[2:]], "passes a joint limit"),
        (lambda cells: [*cells[:5], "0.0", *cells[6:]], "the correction"),
        (lambda cells: [cells[0], "", *cells[2:]], "a number is missing"),
        (lambda cells: cells[:-1], "too few cells"),
    ],
    ids=["limit", "singularity", "no number", "short row"],
)
def test_a_waypoint_that_cannot_be_corrected_is_named_and_nothing_is_written(
    truepath, calibration, tmp_path, change, word
):
    output = tmp_path / "out.csv"
    outcome = truepath("correct", spoiled(tmp_path, 40, change), "-c", calibration, "-o", output)
    assert is_refused(outcome, "spoiled.csv, line 40", word)
    assert [path.name for path in tmp_path.iterdir()] == ["spoiled.csv"]


BEYOND = ("larger than allowed", "weld_path.csv, line 2")


@pytest.mark.parametrize(
    ("bound", "words"), [("0.1", BEYOND), ("0", BEYOND), ("nan", ("is no length",)), ("-1", ("is no length",))]
)
def test_a_correction_beyond_the_stated_bound_leaves_the_old_output_alone(
    truepath, calibration, tmp_path, bound, words
):
    output = tmp_path / "out.csv"
    output.write_text("old")
    outcome = truepath("correct", WELD_PATH, "-c", calibration, "-o", output, f"--max-correction-mm={bound}")
    assert is_refused(outcome, *words)
    assert output.read_text() == "old"


def test_correct_does_not_overwrite_the_program(truepath, calibration, tmp_path):
    path = tmp_path / "weld.csv"
    path.write_bytes(WELD_PATH.read_bytes())
    (tmp_path / "link.csv").symlink_to(path)
    for output in (path, tmp_path / "link.csv"):
        assert is_refused(truepath("correct", path, "-c", calibration, "-o", output), "the output is the input")
    assert path.read_bytes() == WELD_PATH.read_bytes()


@pytest.mark.parametrize("command", ["correct", "export"])
def test_a_calibration_is_not_overwritten_by_what_is_made_with_it(truepath, calibration, tmp_path, command):
    copy = tmp_path / "ur5.json"
    copy.write_bytes(calibration.read_bytes())
    path = [WELD_PATH] if command == "correct" else []
    outcome = truepath(command, *path, "-c", copy, "-o", copy)
    assert copy.read_bytes() == calibration.read_bytes()
    assert is_refused(outcome, "the output is the input")


def test_a_folder_that_does_not_exist_is_no_place_to_write_to(truepath, calibration, tmp_path):
    outcome = truepath("correct", WELD_PATH, "-c", calibration, "-o", tmp_path / "nowhere" / "c.csv")
    assert is_refused(outcome, "the output cannot be written", "nowhere")
    assert truepath("correct", WELD_PATH, "-c", calibration, "-o", tmp_path).code == 2
