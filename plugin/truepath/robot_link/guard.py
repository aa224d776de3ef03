"""The parent's end of the guard that stops a robot when whoever watches it was killed, or is held up."""

from __future__ import annotations

import contextlib
from types import TracebackType

from truepath.robot_link.child_process import ChildProcess
from truepath.robot_link.fault import RobotFault
from truepath.robot_link.text_ports import STARTS_WITHIN_S

START_S = 10.0
SILENCE_S = 3.0  # of a watcher, and nobody watches


class Guard:
    """A context in which a program runs. If it is left without ``release``, in whatever way, the robot is stopped.

    Args:
        host: address of the controller.

    Raises:
        RobotFault: on entering: the guard does not start.
    """

    def __init__(self, host: str) -> None:
        self._host = host
        self._child: ChildProcess | None = None

    def __enter__(self) -> Guard:
        child = ChildProcess("truepath.robot_link.guard_child", [self._host])
        try:
            child.answer(START_S, "setting up the guard of the robot")
        except BaseException:
            child.kill()
            raise
        self._child = child
        return self

    def is_sending(
        self,
        starts_within_s: float = STARTS_WITHIN_S,
        *,
        silence_s: float | None = None,
        tries_s: float | None = None,
    ) -> None:
        """To be said before a program is sent: it may start so much later.

        Args:
            starts_within_s: see above.
            silence_s: after which the robot is stopped, if nothing more is said; None for never.
            tries_s: for how long the robot is told to stop while it does not obey; an hour by default.
        """
        self._say({"do": "sending", "starts_within_s": starts_within_s, "silence_s": silence_s, "tries_s": tries_s})

    def watched(self, *, has_started: bool) -> None:
        """To be said again and again while the program is watched; the robot is stopped after ``SILENCE_S`` without."""
        self._say({"do": "watched", "starts_within_s": 0.0 if has_started else None, "silence_s": SILENCE_S})

    @property
    def is_left(self) -> bool:
        """Whether it goes on by itself: it was not released, and is there."""
        return self._child is not None and self._child.alive

    def release(self) -> None:
        """The robot stands: there is nothing left to guard."""
        child, self._child = self._child, None
        if child is not None:
            with contextlib.suppress(RobotFault):
                child.send({"do": "release"})
            child.close()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._child is not None:
            self._child.leave_alone()

    def _say(self, message: dict[str, object]) -> None:
        if self._child is not None:
            with contextlib.suppress(RobotFault):
                self._child.send(message)
