"""Which robot a program says it is for."""

import numpy as np
import pytest
from truepath.rewriting.named_robot import is_most_of, robot_named_in


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


@pytest.mark.parametrize(("wrong", "count", "is_most"), [(3, 3, False), (2, 4, False), (3, 4, True), (0, 0, False)])
def test_many_wrong_targets_look_like_those_of_another_robot_and_one_does_not(wrong, count, is_most):
    assert is_most_of(np.arange(count) < wrong) is is_most
