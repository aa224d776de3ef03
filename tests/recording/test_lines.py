"""The line protocol of trackers: good lines in any pieces, and everything else named by its line."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from truepath.errors import InputError
from truepath.recording.lines import LONGEST_LINE, LineReader

HEADER = b"t_s,x_mm,y_mm,z_mm\n"
POSE_HEADER = b"t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
GOOD = HEADER + b"0.1,1,2,3\r\nbeam_break\n0.2,-1.5,2e3,3\n"


def numbers(data, *pieces):
    reader = LineReader("tracker")
    return [line.numbers for piece in (data, *pieces) for line in reader.feed(piece)]


def test_readings_and_broken_beams_come_in_the_order_in_which_they_were_said():
    assert numbers(GOOD) == [(0.1, 1.0, 2.0, 3.0), None, (0.2, -1.5, 2000.0, 3.0)]


@given(cuts=st.lists(st.integers(0, len(GOOD)), max_size=8))
def test_it_does_not_matter_in_which_pieces_bytes_arrive(cuts):
    places = [0, *sorted(cuts), len(GOOD)]
    pieces = [GOOD[a:b] for a, b in itertools.pairwise(places)]
    assert numbers(b"", *pieces) == numbers(GOOD)


def test_a_line_counts_when_its_end_has_come():
    reader = LineReader("tracker")
    assert reader.feed(HEADER + b"0.1,1,2,3") == []
    assert reader.feed(b"4\n")[0].numbers == (0.1, 1.0, 2.0, 34.0)


def test_a_probe_gives_quaternions_too():
    assert numbers(POSE_HEADER + b"0,1,2,3,0.6,0,0.8,0\n") == [(0.0, 1.0, 2.0, 3.0, 0.6, 0.0, 0.8, 0.0)]


@pytest.mark.parametrize(
    ("data", "line", "problem", "expected"),
    [
        (b"1,2,3,4\n", 1, "no header", "t_s,x_mm,y_mm,z_mm"),
        (b"t_s,x_m,y_m,z_m\n", 1, "no header", "t_s,x_mm"),
        (HEADER + b"1,2,3\n", 2, "wrong number of columns", "4 numbers"),
        (HEADER + b"1,2,3,4,5\n", 2, "wrong number of columns", "4 numbers"),
        (HEADER + b"1,2,3,4\n\n", 3, "wrong number of columns", "4 numbers"),
        (HEADER + b"1,2,nan,4\n", 2, "not a finite number", "finite"),
        (HEADER + b"1,2,1e999,4\n", 2, "not a finite number", "finite"),
        (HEADER + b"1,2,1_000,4\n", 2, "text where a number belongs", "a number"),
        (HEADER + b"1,2,0x10,4\n", 2, "text where a number belongs", "a number"),
        (HEADER + b"1,2,3,4\n1,2,\xff,4\n", 3, "not UTF-8", "text"),
        (HEADER + b"1,2,3,4\n0.5,2,3,4\n", 3, "time runs backwards", "1.0 or later"),
        (HEADER + b"1,2,3,1e7\n", 2, "no tracker measures so far", "1000 m"),
        (POSE_HEADER + b"0,1,2,3,0.6,0,0.9,0\n", 2, "not of unit length", "length 1"),
        (HEADER + b"1" * (LONGEST_LINE + 1), 2, "without end", "400 bytes"),
        (HEADER + b"1" * (LONGEST_LINE + 1) + b"\n", 2, "too long", "400 bytes"),
        (b"\x00" * 5000, 1, "without end", "400 bytes"),
    ],
)
def test_what_is_no_reading_is_told_with_its_line(data, line, problem, expected):
    with pytest.raises(InputError) as error:
        numbers(data)
    assert error.value.line == line
    assert problem in error.value.problem
    assert expected in error.value.expected
    assert len(str(error.value)) < 500  # and does not pour the hostile bytes onto the terminal


@given(data=st.binary(max_size=3000))
def test_any_bytes_end_in_readings_or_an_error(data):
    try:
        found = numbers(HEADER, data)
    except InputError:
        return
    assert all(line is None or len(line) == 4 for line in found)
