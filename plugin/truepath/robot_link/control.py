"""Control of a robot: the child that moves it, and the script that this child has running on the controller."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

from truepath.robot_link.child_process import ChildProcess, Message
from truepath.robot_link.fault import ControlLost, RobotFault
from truepath.robot_link.guard import Guard
from truepath.robot_link.interruptions import deferred

STARTS_TRIED = 3
START_S = 12.0  # the client uploads its script and waits for it to run
LATE_SCRIPT_S = 3.0  # for which a script may be under way when its client has been killed
GUARDED_S = 20.0  # a control script that is left behind moves nothing
PROBE_S = 1.5
LATE_S = 0.8  # between two kicks of a watchdog that waits for a second
# Errors of the client and of the connection that come before it uploads its script: what runs there is not ours.
NOTHING_SENT = ("already in use", "enable remote control", "refused", "unreachable", "no route", "host not found")
LOST = "the robot was stopped or paused at the pendant, or another program has taken its place"


class Control:
    """Of one robot, taken when it is needed.

    Args:
        host: address of the controller.
        timeout_s: for how long an answer is waited for.
        clear: called when a client was killed whose script may be on its way; it must see that no program stays on
            the robot, for as long as it is told. Raises RobotFault if it cannot be sure.
    """

    def __init__(self, host: str, timeout_s: float, clear: Callable[[float], None]) -> None:
        self._host, self._timeout_s, self._clear = host, timeout_s, clear
        self._child: ChildProcess | None = None
        self._is_lost = False
        self._plays_since_s: float | None = None

    @property
    def is_held(self) -> bool:
        return self._child is not None

    @property
    def is_on(self) -> bool:
        """Whether there is a child to be asked."""
        return self._child is not None and self._child.alive

    @property
    def pid(self) -> int | None:
        return None if self._child is None else self._child.pid

    def last_words(self) -> str:
        return "control was given back" if self._child is None else self._child.last_words()

    def require(self, plays_since_s: float | None) -> None:
        """Takes control, or makes sure that it is still held; nothing moves.

        Args:
            plays_since_s: since when a program has been playing on the controller, see ``Reading``; None if unknown.

        Raises:
            ControlLost: what runs on the robot is no longer ours, and is left alone.
            RobotFault: control cannot be taken, or was lost by what happened on this side.
        """
        if self._is_lost:
            raise ControlLost(LOST)
        if self._child is None:
            self.take()
            return
        if not self._child.alive:
            words, self._child = self._child.last_words(), None
            raise RobotFault(words)
        if self._plays_since_s is None:
            self._plays_since_s = plays_since_s
        why = self.why_silent() if plays_since_s == self._plays_since_s else self.why_lost()
        if why is not None:
            raise why

    def why_silent(self) -> RobotFault | None:
        """Why the script that runs is not ours; None if it is: it does what no other does, and answers."""
        try:
            late_s = self._late_s()
        except RobotFault as fault:
            self._drop()
            return fault
        assert self._child is not None
        try:
            self._child.send({"do": "tcp_offset"})
            if len(self._child.answer(PROBE_S, "asking the control script")) == 6:
                return None
        except RobotFault:
            pass
        self._drop()
        return self._loss(late_s)

    def why_lost(self) -> RobotFault:
        """Why its script is gone. Nothing more is said to the robot."""
        try:
            late_s = self._late_s()
        except RobotFault as fault:
            return fault  # its client has gone, which has ended it
        finally:
            self._drop()
        return self._loss(late_s)

    def _loss(self, late_s: float) -> RobotFault:
        if late_s > LATE_S:
            return RobotFault(
                f"this computer was held up for {late_s:.1f} s, so that the controller has ended the control script"
            )
        self._is_lost = True
        return ControlLost(LOST)

    def take(self, tries: int = STARTS_TRIED, patience_s: float | None = None) -> None:
        """Replaces what runs on the robot by the control script, unless it runs already.

        Raises:
            RobotFault: it does not start.
        """
        if self.is_on:
            return
        self._child = self._plays_since_s = None
        for attempt in range(tries):
            try:
                self._take(patience_s or max(START_S, self._timeout_s))
                return
            except RobotFault:
                # A client that has just been killed may still hold the controller's registers.
                if attempt == tries - 1:
                    raise
                time.sleep(0.5)

    def ask(self, request: Message, timeout_s: float) -> Any:
        """The answer of the child. Raises RobotFault; control is then given back."""
        if self._child is None:
            raise RobotFault(self.last_words())
        try:
            self._child.send(request)
            return self._child.answer(timeout_s, str(request["do"]).replace("_", " "))
        except RobotFault:
            self.give_back()
            raise

    def tell(self, request: Message) -> None:
        """Says something that has no answer. Raises RobotFault if the child has gone."""
        if self._child is None:
            raise RobotFault(self.last_words())
        self._child.send(request)

    def give_back(self) -> None:
        """Ends the script, if it is there."""
        child, self._child = self._child, None
        self._is_lost = False
        if child is not None:
            with deferred():
                with contextlib.suppress(RobotFault):
                    child.send({"do": "close"})
                child.close()

    def _take(self, patience_s: float) -> None:
        with Guard(self._host) as guard:  # for the case that this process is killed while the script is on its way
            guard.is_sending(LATE_SCRIPT_S, tries_s=GUARDED_S)
            child = ChildProcess("truepath.robot_link.control_child", [self._host])
            try:
                child.answer(patience_s, "taking control of the robot")
                self._child = child
            except BaseException as error:
                with deferred():
                    child.kill()
                    if (child.gave_up_itself and _came_before_upload(error)) or self._is_cleared():
                        guard.release()  # else it goes on
                raise
            guard.release()

    def _is_cleared(self) -> bool:
        try:
            self._clear(LATE_SCRIPT_S)
        except RobotFault:
            return False
        return True

    def _late_s(self) -> float:
        """For how long the client has been held up at most. Raises RobotFault if it has gone."""
        if self._child is None:
            raise RobotFault(self.last_words())
        self._child.send({"do": "lateness"})
        return float(self._child.answer(PROBE_S, "asking the client"))

    def _drop(self) -> None:
        """Ends the client without another word to the robot."""
        child, self._child = self._child, None
        if child is not None:
            child.kill()


def _came_before_upload(error: BaseException) -> bool:
    return any(words in str(error).lower() for words in NOTHING_SENT)
