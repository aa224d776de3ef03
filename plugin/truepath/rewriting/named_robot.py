"""Which robot a program says it is for, in the comments at its head; and when it looks like that of another."""

from __future__ import annotations

import re

import numpy as np

from truepath.lie import Array

ANOTHER_ROBOT = "is it a program for another robot?"
FEW = 4  # targets, of which one or two may be wrong by themselves
HEAD_LINES = 60
COMMENTED = re.compile(r"#(.*)$", re.MULTILINE)
STATED = re.compile(
    r"\b(?:robot|controller|machine|model|type)\b\W{1,4}(?:universal robots?\W+)?(UR\W?\d+e?)\b", re.IGNORECASE
)


def robot_named_in(text: str) -> str | None:
    """The robot after a word such as "robot:" in a comment of the first lines; None if no comment says it."""
    head = "\n".join(text.split("\n", HEAD_LINES)[:HEAD_LINES])
    for comment in COMMENTED.findall(head):
        match = STATED.search(comment)
        if match:
            return match[1]
    return None


def is_most_of(wrong: Array) -> bool:
    """Whether so many targets ``(N,)`` are wrong that it is hardly each of them by itself."""
    return len(wrong) >= FEW and bool(2 * np.count_nonzero(wrong) > len(wrong))
