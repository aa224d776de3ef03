"""Text as logical lines, and lines of one shape."""

import pytest
from truepath.programs.urscript.source import logical_lines
from truepath.programs.urscript.syntax import Shapes, columns


def lines(text):
    return list(logical_lines(text, "p.script"))


@pytest.mark.parametrize(
    ("text", "codes"),
    [
        ("a()\r\nb()\rc()\nd()", ["a()", "b()", "c()", "d()"]),
        ("a() # b()\n# c()\n\n \t\nd()", ["a() ", "d()"]),
        ("""a("#") # 'b'\nc('"#')\n""", ['a("#") ', """c('"#')"""]),
        ("a()\u2028b()\n", ["a()\u2028b()"]),
        ('$ 3 "MoveJ"\na()\n', ["a()"]),
        ("a(1,\n  2) # x\nb()\n", ["a(1,   2)", "b()"]),
        ('a("(")\nb()\n', ['a("(")', "b()"]),
    ],
)
def test_comments_and_labels_are_set_aside_and_open_brackets_join_lines(text, codes):
    assert [line.code for line in lines(text)] == codes


def test_lines_know_where_they_are():
    text = "# one\r\n a(1,\r\n2)\r\nb()\r\n"
    found = lines(text)
    assert [line.number for line in found] == [2, 4]
    assert "".join(line.whole for line in found) == text[7:]
    assert [text[line.start] for line in found] == [" ", "b"]


def test_lines_that_differ_in_numbers_texts_and_numbered_names_have_one_shape():
    one, two = lines('movel(p1, a=1, v=0.25, "x")\nmovel(point_27, a=12.5, v=.1, "long # text")\n')
    assert one.shape == two.shape
    assert two.slots == ["point_27", "12.5", ".1", '"long # text"']


@pytest.mark.parametrize("other", ["f(p1)", "f(1.5) ", "f( 1)", "f(-1)", 'f("1")', "g(1)", "f(0x1)"])
def test_all_else_makes_another_shape(other):
    one, two = lines(f"f(1)\n{other}\n")
    assert one.shape != two.shape


def test_nodes_of_a_shape_are_found_in_every_line_of_it():
    one, two = lines("f(1, p[2, x3], 4)\nf(100.25, p[.5, name_33], 0)\n")
    shapes = Shapes("p.script")
    shape = shapes.of(one)
    assert shapes.of(two) is shape
    parts = [columns(node, shape, two) for node in shape.items[0].args[0].args[1]]
    assert [two.code[start:end] for start, end in parts] == ["100.25", "p[.5, name_33]", "0"]
