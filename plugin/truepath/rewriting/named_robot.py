"""Which robot a program says it is for, in the comments at its head."""

from __future__ import annotations

import re

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
