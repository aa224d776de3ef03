"""The note beside a corrected toolpath: by it truepath refuses to correct its own work, as by the stamp of a script."""

import hashlib
import json
from datetime import date

import pytest
from truepath import files
from truepath.errors import InputError
from truepath.rewriting import note
from truepath.rewriting.note import drop_note, note_of, refuse_if_noted, write_with_note
from truepath.stamp import Stamp

CORRECTED, OTHER = b"q1_rad\n0.1\n", b"q1_rad\n0.2\n"


def stamp(content):
    return Stamp("0.9.0", "0f" * 32, "a1" * 32, date(2026, 11, 22), hashlib.sha256(content).hexdigest())


@pytest.fixture
def path(tmp_path):
    write_with_note(tmp_path / "wp.csv", CORRECTED, stamp(CORRECTED))
    return tmp_path / "wp.csv"


@pytest.fixture
def broken(monkeypatch):
    """The disk takes the n-th file no more, and those after it again."""

    def broken(number):
        written = []

        def write(place, content):
            written.append(place)
            if len(written) == number:
                raise InputError("cannot write this file", file=place, found="no space left")
            files.write_atomically(place, content)

        monkeypatch.setattr(note, "write_atomically", write)

    return broken


def is_known(path):
    try:
        refuse_if_noted(path, path.read_bytes())
    except InputError as error:
        return "has corrected this program already" in error.problem
    return False


def test_it_says_what_a_stamp_says(path):
    assert json.loads((path.parent / "wp.csv.truepath.json").read_text()) == {
        "schema": "truepath.corrected/1",
        "version": "0.9.0",
        "program_sha256": "0f" * 32,
        "calibration_sha256": "a1" * 32,
        "corrected_sha256": hashlib.sha256(CORRECTED).hexdigest(),
        "replaced_sha256": None,
        "date": "2026-11-22",
    }
    with pytest.raises(InputError, match=r"2026-11-22 by truepath 0\.9\.0") as caught:
        refuse_if_noted(path, CORRECTED)
    assert caught.value.expected == "the program as it was before"


def test_a_program_that_was_changed_since_or_has_no_note_cannot_be_known(path):
    path.write_bytes(OTHER)
    assert not is_known(path)
    copy = path.with_name("copy.csv")
    copy.write_bytes(CORRECTED)
    assert not is_known(copy)


def test_behind_a_link_it_is_the_same_program(path):
    link = path.with_name("link.csv")
    link.symlink_to(path)
    assert is_known(link)


@pytest.mark.parametrize(
    "content", ["", "{", "[]", '{"schema": "truepath.corrected/2"}', "x" * 100_000, "{" + "[" * 9999]
)
def test_a_note_that_nobody_can_read_is_no_reason_to_go_on(path, content):
    note_of(path).write_text(content)
    with pytest.raises(InputError, match="this is no note of truepath") as caught:
        refuse_if_noted(path, OTHER)
    assert caught.value.file == note_of(path)
    with pytest.raises(InputError, match="this is no note of truepath"):
        write_with_note(path, OTHER, stamp(OTHER))
    assert (path.read_bytes(), note_of(path).read_text()) == (CORRECTED, content)


@pytest.mark.parametrize("day", ["2026-02-30", "yesterday"])
def test_a_day_that_no_calendar_has_is_no_note(path, day):
    note_of(path).write_text(note_of(path).read_text().replace("2026-11-22", day))
    with pytest.raises(InputError, match="this is no note of truepath"):
        refuse_if_noted(path, CORRECTED)


@pytest.mark.parametrize("number", [1, 2])
def test_where_one_of_both_cannot_be_written_neither_is(tmp_path, broken, number):
    broken(number)
    with pytest.raises(InputError, match="cannot write this file"):
        write_with_note(tmp_path / "wp.csv", CORRECTED, stamp(CORRECTED))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [1, 2])
def test_what_was_there_before_stays_with_its_note(path, broken, number):
    before = {each.name: each.read_bytes() for each in path.parent.iterdir()}
    broken(number)
    with pytest.raises(InputError, match="cannot write this file"):
        write_with_note(path, OTHER, stamp(OTHER))
    assert {each.name: each.read_bytes() for each in path.parent.iterdir()} == before


def test_there_is_no_moment_at_which_a_corrected_program_is_not_known(path, monkeypatch):
    def looked_at(place, content):
        assert is_known(path)
        files.write_atomically(place, content)
        assert is_known(path)

    monkeypatch.setattr(note, "write_atomically", looked_at)
    write_with_note(path, OTHER, stamp(OTHER))
    assert (path.read_bytes(), is_known(path)) == (OTHER, True)


def test_a_program_that_needs_no_note_takes_the_place_of_both(path):
    write_with_note(path, OTHER, None)
    assert [each.name for each in path.parent.iterdir()] == ["wp.csv"]


def test_only_notes_are_removed(path):
    note_of(path).write_text("mine")
    drop_note(path)
    write_with_note(path, OTHER, None)
    assert note_of(path).read_text() == "mine"
