"""Which robot a program says it is for."""

import pytest
from truepath.rewriting.named_robot import robot_named_in


@pytest.mark.parametrize(
    ("text", "robot"),
    [
        ("# Robot: UR5\ndef p():\nend\n", "UR5"),
        ("# robot = Universal Robots UR10e\n", "UR10e"),
        ("def p():  # machine: ur-5\nend\n", "ur-5"),
        ("# Controller UR16e, PolyScope 5.11\n", "UR16e"),
        ("# type:UR3\r\ndef p():\r\n", "UR3"),
    ],
)
def test_a_robot_after_the_word_for_it(text, robot):
    assert robot_named_in(text) == robot


@pytest.mark.parametrize(
    "text",
    [
        "def p():\nend\n",
        "# converted from a UR10 program\n",
        'textmsg("robot: UR10")\n',
        "# robot: the one at the window\n",
        "\n" * 100 + "# robot: UR10\n",
    ],
)
def test_programs_that_do_not_say_it(text):
    assert robot_named_in(text) is None
