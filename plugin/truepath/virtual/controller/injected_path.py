"""The path that ur_rtde writes into its control script before it asks for it to be driven."""

from __future__ import annotations

import re
from dataclasses import dataclass

from truepath.errors import InputError

MOST_LINES = 20000
NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
MARK = "# inject move path"
STEP = re.compile(
    r"(movej|movel|movep)\((p?)\[" + ",".join([NUMBER] * 6) + rf"\],a={NUMBER},v={NUMBER},r={NUMBER}\)", re.ASCII
)
PROGRESS = re.compile(r"signal_async_progress\((\d{1,9})\)", re.ASCII)


@dataclass(frozen=True)
class PathStep:
    """A move to a target.

    Attributes:
        joint: along joints; along a line otherwise.
        is_pose: whether ``target`` is a pose of the tool; joints otherwise.
        target: six numbers.
        acceleration, speed, blend_m: as in the script.
        progress: what the client wants to be told when the step begins; None: nothing.
    """

    joint: bool
    is_pose: bool
    target: tuple[float, ...]
    acceleration: float
    speed: float
    blend_m: float
    progress: int | None


def path_in(script: str) -> list[PathStep]:
    """The steps that stand behind the mark; none where nothing was injected.

    Raises:
        InputError: a line that is no step.
    """
    _, mark, rest = script.partition(MARK)
    steps: list[PathStep] = []
    progress = None
    for line in rest.splitlines()[1 if mark else 0 :]:
        text = line.strip()
        if text == "end" or not mark:
            break
        if len(steps) >= MOST_LINES:
            raise InputError("too long a path", expected=f"{MOST_LINES} steps at most")
        if found := PROGRESS.fullmatch(text):
            progress = int(found[1])
        elif found := STEP.fullmatch(text):
            numbers = tuple(float(cell) for cell in found.groups()[2:])
            acceleration, speed, blend_m = numbers[6:]
            is_joint, is_pose = found[1] == "movej", found[2] == "p"
            steps.append(PathStep(is_joint, is_pose, numbers[:6], acceleration, speed, blend_m, progress))
            progress = None
        elif text:
            raise InputError("a step of a path that is none", expected="movej, movel or movep", found=text[:80])
    return steps
