"""Strict reading of delimited text: what is accepted, and what every fault of a file is told as."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from truepath.errors import InputError
from truepath.tables import read_table


@pytest.fixture
def write(tmp_path):
    def write(content: str | bytes):
        path = tmp_path / "table.csv"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def refusal(path, *columns, **options) -> InputError:
    with pytest.raises(InputError) as caught:
        read_table(path, **options).numbers(columns)
    return caught.value


def test_cells_become_numbers_in_the_order_in_which_the_columns_are_asked_for(write):
    table = read_table(write("a,b,c\n1,2.5,-3e-2\n 4 ,+5,6\n"))
    assert table.header == ("a", "b", "c")
    assert len(table) == 2
    np.testing.assert_array_equal(table.numbers(["c", "a"]), [[-0.03, 1], [6, 4]])
    assert table.text("b") == ["2.5", "+5"]


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_lines_end_as_on_any_system(write, newline):
    table = read_table(write(newline.join(["a,b", "1,2", "3,4", ""])))
    np.testing.assert_array_equal(table.numbers(["a", "b"]), [[1, 2], [3, 4]])
    assert list(table.lines) == [2, 3]


def test_the_last_line_needs_no_newline_but_a_missing_one_is_told(write, caplog):
    assert read_table(write("a\n1\n2")).numbers(["a"])[:, 0].tolist() == [1, 2]
    (told,) = caplog.messages
    assert told.endswith("table.csv, line 3: the last line has no line end: was the file cut off?")


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "a,b\r1,2\r", "a,b\r\n1,2\r\n", "a,b\n1,2\n  ", "a,b\n1,2\n,"])
def test_where_the_last_row_is_whole_nothing_is_told(write, caplog, text):
    assert not read_table(write(text)).ends_within_a_line
    assert caplog.messages == []


def test_a_caller_may_tell_it_by_itself(write, caplog):
    assert read_table(write("a,b\n1,2"), tell_cut_off=False).ends_within_a_line
    assert caplog.messages == []


def test_a_byte_order_mark_is_no_part_of_the_first_name(write):
    assert read_table(write(b"\xef\xbb\xbfa,b\n1,2\n")).header == ("a", "b")


def test_blank_lines_at_the_end_are_ignored(write):
    assert len(read_table(write("a,b\n1,2\n\n  \n,\n\n"))) == 1


def test_blanks_around_names_and_cells_do_not_matter(write):
    table = read_table(write(" a , b\n1 ,\t2\n"))
    np.testing.assert_array_equal(table.numbers(["a", "b"]), [[1, 2]])


def test_a_quoted_cell_may_hold_the_delimiter_and_a_line_break_and_lines_are_still_counted_right(write):
    table = read_table(write('a,b\n"x, y\nz",1\nw,2\n'))
    assert table.text("a") == ["x, y\nz", "w"]
    assert table.lines[1] == 4


def test_a_decimal_comma_is_read_where_the_format_has_one(write):
    table = read_table(write("a;b\n1,5;-2,25e1\n"), delimiter=";", decimal=",")
    np.testing.assert_array_equal(table.numbers(["a", "b"]), [[1.5, -22.5]])


def test_the_bytes_of_the_file_are_kept(write):
    content = b"\xef\xbb\xbfa\r\n1\r\n\r\n"
    assert read_table(write(content)).raw == content


BAD_CELLS = {
    "": "a number is missing",
    "  ": "a number is missing",
    "fast": "text where a number belongs",
    "1.2.3": "text where a number belongs",
    "1 000": "text where a number belongs",
    "1_000": "text where a number belongs",
    "١٢": "text where a number belongs",
    "0x10": "text where a number belongs",
    "1.0mm": "text where a number belongs",
    "nan": "not a number (NaN)",
    "-NaN": "not a number (NaN)",
    "inf": "an infinite number",
    "-Infinity": "an infinite number",
    "1e999": "an infinite number",
    '"1,5"': "a decimal comma where a decimal point belongs",
}


@pytest.mark.parametrize("cell", BAD_CELLS)
def test_a_cell_that_is_no_finite_number_is_told_with_its_line_and_column(write, cell):
    error = refusal(write(f"a,b,c\n1,2,3\n4,{cell},6\n7,8,9\n"), "a", "b", "c")
    assert (error.problem, error.line, error.column) == (BAD_CELLS[cell], 3, "b")
    assert error.expected == "a finite number with decimal point"
    assert error.found == repr(cell.strip().strip('"'))
    assert str(error).startswith(f"{error.file}, line 3, column 'b': {BAD_CELLS[cell]}")


def test_the_first_of_several_faults_is_told(write):
    assert refusal(write("a\n1\nx\ny\n"), "a").line == 3


def test_a_column_that_nobody_asks_for_may_hold_anything(write):
    table = read_table(write("a,remark\n1,\n2,slow\n3,nan\n"))
    np.testing.assert_array_equal(table.numbers(["a"])[:, 0], [1, 2, 3])


def test_a_decimal_point_is_refused_where_the_format_has_a_comma(write):
    error = refusal(write("a;b\n1,5;2\n1,5;2.5\n"), "a", "b", delimiter=";", decimal=",")
    assert (error.problem, error.line, error.column) == ("text where a number belongs", 3, "b")
    assert error.expected == "a finite number with decimal comma"


def test_two_decimal_commas_are_no_number(write):
    error = refusal(write("a;b\n1,234,5;2\n"), "a", delimiter=";", decimal=",")
    assert error.problem == "text where a number belongs"


def test_a_missing_column_is_told_with_the_name_that_looks_like_it(write):
    with pytest.raises(InputError) as caught:
        read_table(write("alpha,betta\n1,2\n")).require(["alpha", "beta"])
    error = caught.value
    assert (error.problem, error.line, error.column) == ("a column is missing", 1, "beta")
    assert "did you mean 'betta'?" in error.found
    assert "alpha, beta" in error.expected


def test_a_missing_column_that_looks_like_none_gets_no_suggestion(write):
    with pytest.raises(InputError) as caught:
        read_table(write("alpha,gamma\n1,2\n")).require(["alpha", "xyz"])
    assert "did you mean" not in caught.value.found


def test_a_doubled_column_is_refused(write):
    error = refusal(write("a,b, a\n1,2,3\n"))
    assert (error.problem, error.line, error.column) == ("a column appears twice", 1, "a")


@pytest.mark.parametrize(("row", "cells"), [("1", 1), ("1,2,3", 3), ("1,5,2", 3)])
def test_a_ragged_row_is_told_with_its_line_and_both_counts(write, row, cells):
    error = refusal(write(f"a,b\n1,2\n{row}\n3,4\n"))
    assert (error.problem, error.line) == ("a row has too many or too few cells", 3)
    assert error.expected.startswith("2 cells")
    assert error.found == str(cells)


def test_a_blank_line_between_rows_is_refused(write):
    error = refusal(write("a,b\n1,2\n\n3,4\n"))
    assert (error.problem, error.line) == ("a row is empty", 3)


@pytest.mark.parametrize("content", ["", "\n", "\n\n \n", b"\xef\xbb\xbf", b"\xef\xbb\xbf\r\n"])
def test_an_empty_file_is_told_as_such(write, content):
    assert refusal(write(content)).problem == "the file is empty"


def test_a_blank_first_line_is_no_header(write):
    error = refusal(write("\na,b\n1,2\n"))
    assert (error.problem, error.line) == ("the first line is empty", 1)


@pytest.mark.parametrize("content", ["a,b", "a,b\n", "a,b\n\n\n"])
def test_a_header_without_rows_is_told_as_such(write, content):
    assert refusal(write(content)).problem == "the file has a header but no rows"


@pytest.mark.parametrize(("delimiter", "other"), [(",", ";"), (",", "\t"), (";", ",")])
def test_another_delimiter_is_recognised(write, delimiter, other):
    error = refusal(write(f"a{other}b\n1{other}2\n"), delimiter=delimiter)
    assert (error.problem, error.line) == ("the columns are separated by something else", 1)
    assert repr(delimiter) in error.expected


@pytest.mark.parametrize(
    ("content", "line", "byte"),
    [
        (b"a,b\n1,2\n3,\xff4\n", 3, "0xff"),
        (b"\xef\xbb\xbf\n\n\xfe", 3, "0xfe"),
        (b"temp\xe9rature\n1\n", 1, "0xe9"),
        ("a,b\n1,2\n".encode("utf-16"), 1, "0xff"),
    ],
    ids=["stray byte", "after a byte order mark", "Latin-1", "UTF-16"],
)
def test_a_file_that_is_not_utf8_is_told_with_line_and_byte(write, content, line, byte):
    error = refusal(write(content))
    assert (error.problem, error.line) == ("the file is not UTF-8 text", line)
    assert byte in error.found


def test_a_quote_that_never_ends_is_refused(write):
    error = refusal(write('a,b\n1,"2\n3,4\n'))
    assert error.problem.startswith("the table is broken")
    assert error.line is not None


def test_a_cell_without_end_is_refused(write):
    assert refusal(write("a\n" + "9" * 200_000 + "\n"), "a").problem.startswith("the table is broken")


def test_a_missing_file_is_told_as_such(tmp_path):
    error = refusal(tmp_path / "nowhere.csv")
    assert error.problem == "no such file"
    assert "nowhere.csv" in str(error)


def test_a_path_through_a_file_is_no_such_file(write):
    assert refusal(write("a\n1\n") / "below.csv").problem == "no such file"


def test_a_folder_is_no_file(tmp_path):
    assert refusal(tmp_path).problem == "this is not a file"


def test_a_name_longer_than_the_system_allows_is_refused(tmp_path):
    assert refusal(tmp_path / ("x" * 5000)).problem == "the file cannot be read"


def test_a_file_that_is_far_too_large_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "huge.csv"
    with path.open("wb") as file:
        file.truncate((1 << 30) + 1)  # sparse: takes no room
    assert refusal(path).problem == "the file is larger than 1 GiB"


@given(st.lists(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=2), min_size=1))
def test_every_finite_number_is_read_back_to_the_last_bit(tmp_path_factory, rows):
    path = tmp_path_factory.getbasetemp() / "numbers.csv"
    path.write_text("a,b\n" + "".join(f"{a!r},{b!r}\n" for a, b in rows))
    assert read_table(path).numbers(["a", "b"]).tobytes() == np.array(rows, float).tobytes()


@given(st.binary(max_size=200), st.sampled_from([",", ";"]), st.sampled_from([".", ","]))
def test_whatever_the_bytes_a_table_is_read_or_refused(tmp_path_factory, content, delimiter, decimal):
    path = tmp_path_factory.getbasetemp() / "bytes.csv"
    path.write_bytes(content)
    try:
        table = read_table(path, delimiter=delimiter, decimal=decimal)
        values = table.numbers(table.header)
    except InputError:
        return
    assert values.shape == (len(table), len(table.header))
    assert np.isfinite(values).all()
