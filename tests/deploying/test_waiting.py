"""For how long a robot may stand, and what a person types before he is asked."""

import os
import threading
import time

import numpy as np
import pytest
from truepath import console
from truepath.controller import controller_of
from truepath.deploying.rehearsal import rehearse
from truepath.deploying.stall import may_stand

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
MOVE = "movej([0.05, -1.57, 1.57, -1.57, -1.57, 0])"


@pytest.mark.parametrize(
    ("before", "stall_s", "expected"),
    [
        ("sleep(30)", None, (60.0, False)),
        ("sleep(1)", None, (20.0, False)),
        ("sleep(1)", 90.0, (90.0, False)),
        ("if get_standard_digital_in(0):\nsync()\nend", None, (20.0, True)),
        ("if get_standard_digital_in(0):\nsync()\nend", 90.0, (90.0, False)),
    ],
)
def test_how_long_it_may_stand(ur5, before, stall_s, expected):
    rehearsal = rehearse(f"{MOVE}\n{before}\n{MOVE}\n", controller_of(ur5), HOME, [0.0] * 6)
    assert may_stand(rehearsal, stall_s) == expected


def test_what_was_typed_before_the_question_is_no_answer(monkeypatch):
    master, slave = os.openpty()
    with open(slave) as terminal:
        monkeypatch.setattr("sys.stdin", terminal)
        os.write(master, b"y\n")
        time.sleep(0.05)
        answers = threading.Timer(0.4, os.write, (master, b"n\n"))
        answers.start()
        assert console.agrees("Is the way clear?") is False
        answers.join()
    os.close(master)
