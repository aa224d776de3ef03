"""Rows on the disk: what is there stays, half of a line goes, nothing is taken for what it is not."""

import fcntl
import json
from dataclasses import replace

import numpy as np
import pytest
from truepath.errors import InputError
from truepath.lie import from_rotation_vector
from truepath.measurements import from_table
from truepath.planning.pose_list import PoseList
from truepath.recording.circumstances import Circumstances
from truepath.recording.readings import Reading
from truepath.recording.row_file import RowFile, progress_file
from truepath.recording.visit import Visit, cells, columns
from truepath.tables import read_table

POSES = PoseList(
    np.random.default_rng(0).uniform(-1, 1, (5, 6)), np.array([1, 0, 1, 1, 1], bool), np.array([4, -1, 5, 6, 7])
)
HEADER = columns(6, with_orientation=False)
HASH = "ab" * 32


def visit_of(row, R_ME=None):
    return Visit(
        row=row,
        pose_id=int(POSES.pose_id[row]),
        q_rad=POSES.q_rad[row],
        q_actual_rad=POSES.q_rad[row] + 1e-5,
        temperatures_c=np.array([30.0, 31, 32, 33, 34, 35]),
        approach=np.array([1, -1, 0, 1, 1, -1]),
        time_s=10.0 * row,
        payload_kg=0.5,
        reading=Reading(np.array([1.0, 2.0, 3.0 + row]), R_ME, 0.02, 99, 5.0),
    )


def opened(path, resume=False, sha256=HASH, header=HEADER, poses=POSES):
    return RowFile(path, poses, sha256, header, resume=resume)


@pytest.fixture
def data(tmp_path):
    """A recording with rows 0 and 2 of the list."""
    path = tmp_path / "data.csv"
    with opened(path) as rows:
        for row in (0, 2):
            rows.append(row, cells(visit_of(row)))
    return path


def test_a_recording_is_a_data_set(data):
    found = from_table(read_table(data), 6)
    assert np.allclose(found.q_rad, POSES.q_rad[[0, 2]], atol=1e-11, rtol=0)
    assert np.allclose(found.p_ME, [[1, 2, 3], [1, 2, 5]])
    assert found.temperature_c.tolist() == [32.5, 32.5]
    assert found.payload_kg.tolist() == [0.5, 0.5]
    assert found.time_s.tolist() == [0.0, 20.0]
    assert found.approach.tolist() == [[1, -1, 0, 1, 1, -1]] * 2
    assert len(set(found.pose_id)) == 2


def test_a_probe_adds_its_orientation(tmp_path):
    R_ME = from_rotation_vector(np.array([0.1, 0.2, 0.3]))
    with opened(tmp_path / "probe.csv", header=columns(6, with_orientation=True)) as rows:
        rows.append(3, cells(visit_of(3, R_ME)))
    assert np.allclose(from_table(read_table(tmp_path / "probe.csv"), 6).R_ME, R_ME)


def test_an_output_that_exists_is_not_touched(data):
    before = data.read_bytes()
    with pytest.raises(InputError, match="--resume"):
        opened(data)
    assert data.read_bytes() == before


def test_resuming_knows_what_is_done_and_goes_on_behind_it(data):
    before = data.read_bytes()
    with opened(data, resume=True) as rows:
        assert rows.done == {0, 2}
        rows.append(3, cells(visit_of(3)))
    assert data.read_bytes().startswith(before)
    with opened(data, resume=True) as rows:
        assert rows.done == {0, 2, 3}


def test_what_is_taken_over_can_be_held_against_what_comes(data):
    with opened(data, resume=True) as rows:
        assert rows.taken_over.row.tolist() == [0, 2]
        assert np.allclose(rows.taken_over.q_rad, POSES.q_rad[[0, 2]], atol=1e-9)
        assert np.allclose(rows.taken_over.p_ME, [[1, 2, 3], [1, 2, 5]])


def test_a_row_of_other_columns_is_not_written(data):
    before = data.read_bytes()
    with opened(data, resume=True) as rows, pytest.raises(InputError, match="other columns"):
        rows.append(3, cells(visit_of(3, np.eye(3))))
    assert data.read_bytes() == before


def test_who_comes_too_late_touches_nothing(tmp_path):
    """The other has created the file, and has not written yet what it is a recording of."""
    path = tmp_path / "data.csv"
    with path.open("wb") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(InputError, match="somebody else"):
            opened(path, resume=True)
    assert list(tmp_path.iterdir()) == [path]


def test_a_recorder_that_was_killed_as_it_began_leaves_a_file_to_begin_with(tmp_path):
    path = tmp_path / "data.csv"
    path.touch()
    with opened(path, resume=True) as rows:
        rows.append(0, cells(visit_of(0)))
    with opened(path, resume=True) as rows:
        assert rows.done == {0}


def test_wherever_the_last_line_breaks_off_only_complete_rows_count(data):
    whole = data.read_bytes()
    ends = [k for k, byte in enumerate(whole, 1) if byte == ord("\n")]
    for cut in range(0, len(whole), 23):
        data.write_bytes(whole[:cut])
        with opened(data, resume=True) as rows:
            complete = sum(end <= cut for end in ends)
            assert rows.done == set([0, 2][: max(complete - 1, 0)])
        assert data.read_bytes() == whole[: max([ends[0], *(end for end in ends if end <= cut)])]


def test_resuming_nothing_is_beginning(tmp_path):
    with opened(tmp_path / "new.csv", resume=True) as rows:
        assert rows.done == set()


def test_another_list_of_poses_is_refused(data):
    with pytest.raises(InputError, match="another list"):
        opened(data, resume=True, sha256="cd" * 32)


@pytest.mark.parametrize("content", ["", "{}", "[]", '{"schema": "truepath.recording/1", "began_unix_s": "x"}'])
def test_without_the_file_that_says_what_it_is_nothing_is_resumed(data, content):
    progress_file(data).write_text(content)
    with pytest.raises(InputError, match="nothing says of which poses"):
        opened(data, resume=True)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda row: {**row, "visit": "2"}, "no row of the pose list"),
        (lambda row: {**row, "visit": "99"}, "no row of the pose list"),
        (lambda row: {**row, "visit": "-1"}, "no row of the pose list"),
        (lambda row: {**row, "visit": "1"}, "appears twice"),
        (lambda row: {**row, "q3_rad": "0.123"}, "not those of the pose list"),
        (lambda row: {**row, "x_mm": "1.0x"}, "text where a number belongs"),
    ],
)
def test_a_row_that_is_not_of_this_list_is_refused(data, change, problem):
    lines = data.read_text().splitlines()
    row = change(dict(zip(HEADER, lines[2].split(","), strict=True)))
    data.write_text("\n".join([*lines[:2], ",".join(row.values())]) + "\n")
    with pytest.raises(InputError, match=problem) as error:
        opened(data, resume=True)
    assert error.value.line == 3


def test_other_columns_are_refused(data):
    with pytest.raises(InputError, match="other columns"):
        opened(data, resume=True, header=columns(6, with_orientation=True))


def test_two_recordings_into_one_file_are_refused(data):
    with opened(data, resume=True), pytest.raises(InputError, match="somebody else"):
        opened(data, resume=True)


def test_time_goes_on_from_the_last_row_even_if_the_clock_was_set_back(data):
    side = json.loads(progress_file(data).read_text())
    progress_file(data).write_text(json.dumps(side | {"began_unix_s": side["began_unix_s"] + 1e6}))
    with opened(data, resume=True) as rows:
        assert rows.time_s() == 20.0


UNDER = Circumstances("ab" * 32, 1.03, "simulated", "20240000001")


def under(path, circumstances, resume=True):
    return RowFile(path, POSES, HASH, HEADER, resume=resume, circumstances=circumstances)


@pytest.mark.parametrize(
    ("name", "value"),
    [("model_sha256", "cd" * 32), ("payload_kg", 3.0), ("tracker", "tcp:a:1"), ("serial_number", "20240000002")],
)
def test_a_recording_does_not_go_on_under_other_circumstances(tmp_path, name, value):
    path = tmp_path / "data.csv"
    with under(path, UNDER, resume=False) as rows:
        rows.append(0, cells(visit_of(0)))
    with under(path, replace(UNDER, payload_kg=1.031)) as rows:
        assert rows.done == {0}
    with pytest.raises(InputError, match="other circumstances") as error:
        under(path, replace(UNDER, **{name: value}))
    assert error.value.column == name


def test_a_recording_that_tells_no_circumstances_goes_on(data):
    content = json.loads(progress_file(data).read_text())
    del content["circumstances"]
    progress_file(data).write_text(json.dumps(content))
    with under(data, UNDER) as rows:
        assert rows.done == {0, 2}


def test_a_file_without_a_row_is_taken_away(tmp_path):
    with opened(tmp_path / "data.csv"):
        pass
    assert list(tmp_path.iterdir()) == []
