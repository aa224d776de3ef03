"""What goes wrong with a robot, as opposed to what a user got wrong."""

from __future__ import annotations


class RobotFault(RuntimeError):  # noqa: N818 - an event at the robot, not a mistake in a program
    """The robot stopped, is lost or does not answer in time. Nobody knows more than its words say.

    Attributes:
        reason: one plain sentence.
    """

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


class ControlLost(RobotFault):
    """The control script of a link has ended or is paused, and not by its doing.

    A person stopped or paused the robot, or another program has taken its place. Whatever runs there now is not ours:
    it is neither replaced nor stopped.
    """
