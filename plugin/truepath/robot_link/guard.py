"""The parent's end of the guard that stops a robot when whoever watches it was killed."""

from __future__ import annotations

import contextlib
from types import TracebackType

from truepath.robot_link.child_process import ChildProcess
from truepath.robot_link.fault import RobotFault

START_S = 10.0


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
