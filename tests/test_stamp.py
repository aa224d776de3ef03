"""The stamp of a corrected program: read back strictly, and nowhere but in a comment of its own."""

import hashlib
from datetime import date

import pytest
import truepath
from hypothesis import given
from hypothesis import strategies as st
from truepath.errors import InputError
from truepath.stamp import Stamp, body_sha256, find_stamp, refuse_if_stamped, sealed

STAMP = Stamp("0.3.0", "0f" * 32, "a1" * 32, date(2026, 11, 22))
LINE = f"# truepath-corrected version=0.3.0 program-sha256={'0f' * 32} calibration-sha256={'a1' * 32} date=2026-11-22"
PROGRAM = 'def weld():\n  movej([0, 1, 2, 3, 4, 5])\n  textmsg("done # not yet")\nend\n'


def test_the_line_is_what_is_documented():
    assert STAMP.line("#") == LINE
    assert STAMP.line("//") == "//" + LINE[1:]
    with_body = LINE.replace(" date", f" body-sha256={'5c' * 32} date")
    assert find_stamp(with_body, "p", "#")[0].body_sha256 == "5c" * 32
    assert find_stamp(with_body, "p", "#")[0].line("#") == with_body


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("before", ["", "\ufeff", "# a plate@"])
def test_a_sealed_program_has_the_hash_of_all_but_the_line_of_its_stamp(end, before):
    before, body = (text.replace("@", end) for text in (before, "def weld():@  movej(q)@end"))
    content = sealed(f"{before}{LINE}{end}{body}".encode(), STAMP, "#")
    stamp, line = find_stamp(content.decode(), "p", "#")
    others = f"{before}{body}".removeprefix("\ufeff").encode()  # a byte order mark stands in the first line
    assert stamp.body_sha256 == body_sha256(content, line) == hashlib.sha256(others).hexdigest()
    assert body_sha256(content.replace(b"movej", b"movel"), line) != stamp.body_sha256
    assert body_sha256(content + b" ", line) != stamp.body_sha256
    assert content.replace(f" body-sha256={stamp.body_sha256}".encode(), b"") == f"{before}{LINE}{end}{body}".encode()


def test_a_format_that_writes_no_stamp_stays_as_it_is():
    assert sealed(PROGRAM.encode(), STAMP, "#") == PROGRAM.encode()


def test_a_stamp_hashes_both_files():
    stamp = Stamp.of(b"movej()", b"{}", date(2026, 1, 2))
    assert stamp.program_sha256 == hashlib.sha256(b"movej()").hexdigest()
    assert stamp.calibration_sha256 == hashlib.sha256(b"{}").hexdigest()
    assert stamp.version == truepath.__version__
    assert find_stamp(stamp.line("#"), "p", "#") == (stamp, 1)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("comment", ["#", "!", "//", ";", "--"])
def test_it_is_found_with_any_line_end_and_comment_sign(end, comment):
    text = end.join([STAMP.line(comment), "code", ""])
    assert find_stamp(text, "p", comment) == (STAMP, 1)
    assert find_stamp(end.join(["code", "  \t" + STAMP.line(comment) + " \t", ""]), "p", comment) == (STAMP, 2)


def test_it_is_found_behind_a_byte_order_mark():
    assert find_stamp("\ufeff" + LINE + "\n" + PROGRAM, "p", "#") == (STAMP, 1)


def test_a_program_without_one_has_none():
    assert find_stamp(PROGRAM, "p", "#") is None
    assert find_stamp("", "p", "#") is None
    refuse_if_stamped(PROGRAM, "p", "#")


@pytest.mark.parametrize(
    "text",
    [
        f'textmsg("{LINE}")',
        f"movej(q) {LINE}",
        f'a = "\n{LINE}\n"',  # a string over three lines, as a cell of a CSV may be
        f'x,y\n"one\n{LINE}",2\n',
        f'"# " "\n{LINE}\n"',  # the comment sign within a string starts no comment
        LINE[2:],
        f"## {LINE[2:]}",
        f"# see {LINE[2:]}",
        LINE.replace("truepath-corrected", "truepath-corrected-by-hand"),
        f'a = "x\u2028{LINE}"',
        f'a = "x\x0c{LINE}"',
        f"x = 1\x0b{LINE}",
    ],
)
def test_it_is_not_seen_in_strings_nor_behind_code(text):
    assert find_stamp(text, "p", "#") is None


@pytest.mark.parametrize(
    "before",
    ['# a plate of 5" width\n', 'textmsg("a # b") # a 3" pipe\n', 'a = ""\n', 'textmsg("x")\n', 'textmsg("#")\n'],
)
def test_quotes_in_comments_and_closed_strings_do_not_hide_it(before):
    assert find_stamp(before + LINE, "p", "#") == (STAMP, 2)


@pytest.mark.parametrize(
    "changed",
    [
        LINE.replace("0f0f", "0g0f", 1),
        LINE.replace("0f0f", "0f", 1),
        LINE.replace("0f", "0F", 1),
        LINE.replace("2026-11-22", "2026-02-30"),
        LINE.replace("2026-11-22", "22.11.2026"),
        LINE.replace("version=", "version"),
        LINE.replace(" date", "  date"),
        LINE + " again",
        "# truepath-corrected",
    ],
)
def test_a_stamp_that_was_changed_is_no_licence(changed):
    with pytest.raises(InputError, match="its stamp was changed") as caught:
        refuse_if_stamped(f"def weld():\n{changed}\n", "weld.script", "#")
    assert (caught.value.file, caught.value.line) == ("weld.script", 2)


def test_a_corrected_program_is_refused_with_what_is_known_of_it():
    with pytest.raises(InputError, match="has corrected this program already") as caught:
        refuse_if_stamped(PROGRAM + LINE, "weld.script", "#")
    assert (caught.value.file, caught.value.line) == ("weld.script", 5)
    for known in ("2026-11-22", "0.3.0", "0f0f0f0f0f0f", "a1a1a1a1a1a1"):
        assert known in caught.value.found


@given(st.text(alphabet='ab "#\n\r\t\\', max_size=60))
def test_code_before_it_can_hide_it_in_a_string_only(code):
    """A string that is open when the stamp comes; else whatever stands before is of no concern."""
    in_string = in_comment = False
    for character in code:
        if character in "\r\n":
            in_comment = False
        elif character == '"' and not in_comment:
            in_string = not in_string
        elif character == "#" and not in_string:
            in_comment = True
    found = find_stamp(f"{code}\n{LINE}\n", "p", "#")
    assert (found is None) == in_string
