"""Sends a program and watches it until it ends, one way or another; the robot never moves on unwatched."""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from truepath.deploying.passages import Passages
from truepath.deploying.rehearsed_way import RehearsedWay
from truepath.deploying.run_file import RunFile
from truepath.deploying.stall import Stall
from truepath.errors import InputError
from truepath.lie import Array
from truepath.robot_link import RobotFault, RobotLink, RobotState
from truepath.robot_link.guard import SILENCE_S, Guard
from truepath.robot_link.interruptions import uninterrupted
from truepath.robot_link.readiness import MODES, is_in_remote_control
from truepath.robot_link.state import RUNNING_MODE
from truepath.robot_link.stopping import RESTS_WITHIN_S, Rest
from truepath.robot_link.text_ports import STARTS_WITHIN_S

LOOK_EVERY_S = 0.04
START_SILENCE_S = 5.0  # while a program is sent, nobody can say that he watches
MOVED_RAD = 1e-6


class Watched(Protocol):
    """What is told about a program while it runs."""

    def __call__(self, passed: int, state: RobotState) -> None:
        """How many targets are passed, and the newest sample."""


@dataclass(eq=False)
class Followed:
    """How a run went.

    Attributes:
        ended: ``"completed"``, or what stopped it, in words.
        completed: the program ran to its end.
        interrupted: by Ctrl-C.
        duration_s: of the program, by the controller's clock.
        samples: how many were seen.
        lag_rad: largest difference of actual and target joints.
        gap_s: longest time between two samples, by the controller's clock.
        last: newest sample; None if there was none.
    """

    ended: str = ""
    completed: bool = False
    interrupted: bool = False
    duration_s: float = 0.0
    samples: int = 0
    lag_rad: float = 0.0
    gap_s: float = 0.0
    last: RobotState | None = None


def send_and_follow(
    link: RobotLink,
    text: str,
    passages: Passages,
    way: RehearsedWay,
    record: RunFile,
    stall: Stall,
    watched: Watched,
) -> Followed:
    """Runs a program on a robot that was found ready.

    Whatever ends this before the program ends, the robot is told to stop.

    Args:
        link: to the robot.
        text: of the program.
        passages: of its targets.
        way: on which it must stay.
        record: gets every sample.
        stall: what a robot that stands while its program runs means.
        watched: is told how it goes.

    Raises:
        RobotFault: the dashboard is silent, or the program could not be sent; says what is known of the robot.
        InputError: the record cannot be begun.
    """
    if is_in_remote_control(link) is False:
        raise RobotFault("the robot is in local control: it can be stopped from the teach pendant only")
    link.state()
    link.samples()
    with Guard(link.host) as guard:
        run, sent = _Run(link, guard, passages, way, record, watched), False
        try:
            guard.is_sending(silence_s=run.silence_s)
            link.send_program(text)
            sent = True
            run.until_started()
            run.until_ended(stall)
        except RobotFault as fault:
            run.stopped(fault.reason)
            if not sent:
                raise RobotFault(run.followed.ended) from None
        except InputError as error:  # the disk is full
            run.stopped(f"the record cannot be written ({error.found or error.problem})")
        except KeyboardInterrupt:
            run.followed.interrupted = True
            run.stopped("stopped by Ctrl-C")
        except BaseException:
            run.stopped("stopped")
            raise
        finally:
            if run.stands:
                guard.release()
            run.finish()
    return run.followed


class _Run:
    def __init__(
        self, link: RobotLink, guard: Guard, passages: Passages, way: RehearsedWay, record: RunFile, watched: Watched
    ) -> None:
        self.link, self.guard, self.passages, self.way = link, guard, passages, way
        self.record, self.watched = record, watched
        self.looked_s, self.silence_s = time.monotonic(), link.timeout_s + START_SILENCE_S
        self.followed = Followed()
        self.stands = False
        self.strayed: str | None = None
        self.started_s: float | None = None
        self.q_target: Array | None = None
        self.moved_s = time.monotonic()

    def until_started(self) -> None:
        """The port does not answer: that the program has begun shows in the samples."""
        end = time.monotonic() + STARTS_WITHIN_S
        while self.started_s is None:
            self.look()
            if time.monotonic() > end:
                raise RobotFault(
                    f"the robot has not started the program within {STARTS_WITHIN_S:.0f} s: is it valid for it?"
                )

    def until_ended(self, stall: Stall) -> None:
        """A program is over when the robot says so and stands; one that is paused may go on."""
        rest, ran_s = Rest(), time.monotonic()
        while True:
            state = self.look()
            if rest.take(state):
                break
            now_s = time.monotonic()
            if state.program_running:
                ran_s = now_s
            if now_s - ran_s > RESTS_WITHIN_S:
                raise RobotFault(f"the robot still moves {RESTS_WITHIN_S:.0f} s after its program has ended")
            if now_s - self.moved_s > stall.after_s:
                stands = f"the robot has stood for {stall.after_s:.0f} s while its program runs"
                if stall.tell is None:
                    raise RobotFault(stands)
                stall.tell(stands)
                self.moved_s = now_s
        self.stands = True
        self.followed.ended, self.followed.completed = "completed", True

    def look(self) -> RobotState:
        """Takes in what has arrived.

        Raises:
            RobotFault: the robot was stopped, is lost, or goes where it was not to go.
        """
        time.sleep(LOOK_EVERY_S)
        self._require_watched()
        try:
            if not self.link.is_reading:
                raise RobotFault("the client of the robot has gone")
            state, samples = self.link.state(), self.link.samples()
        except RobotFault as fault:
            raise RobotFault(f"the connection was lost ({fault.reason})") from None
        self.take(samples)
        if not state.able_to_move:
            raise RobotFault(_why_unable(state))
        if self.strayed is not None:
            raise RobotFault(self.strayed)
        return state

    def _require_watched(self) -> None:
        """Raises RobotFault if this process was held up, so that the guard has had to stop the robot."""
        now_s, before_s = time.monotonic(), self.looked_s
        self.looked_s = now_s
        silence_s, self.silence_s = self.silence_s, SILENCE_S
        if now_s - before_s > silence_s:
            raise RobotFault(
                f"this process was held up for {now_s - before_s:.0f} s, in which nobody watched the robot"
            )
        self.guard.watched(has_started=self.link.sent_program_has_begun)

    def take(self, samples: list[RobotState]) -> None:
        if not samples:
            return
        time_s = np.array([each.time_s for each in samples])
        q = np.array([each.q_rad for each in samples])
        q_target = np.array([each.q_target_rad for each in samples])
        running = np.array([each.program_running for each in samples])
        followed = self.followed
        before = time_s[:1] if followed.last is None else [followed.last.time_s]
        followed.gap_s = max(followed.gap_s, float(np.diff(time_s, prepend=before).max()))
        followed.last = samples[-1]
        followed.samples += len(samples)
        followed.lag_rad = max(followed.lag_rad, float(np.abs(q - q_target).max()))
        if self.started_s is None and running.any():
            self.started_s = float(time_s[np.argmax(running)])
        if self.started_s is not None:
            if running.any():
                followed.duration_s = float(time_s[running][-1]) - self.started_s
            if self.strayed is None and running.any() and self.way.holds(self.passages.count):
                self.strayed = self.way.strayed(q[running])
            self.passages.take(time_s, q)
        if self.q_target is None or np.abs(q_target - self.q_target).max() > MOVED_RAD:
            self.moved_s = time.monotonic()
        self.q_target = q_target[-1]
        self.record.append(time_s, self.passages.count, q, q_target)
        self.watched(self.passages.count, samples[-1])

    def stopped(self, why: str) -> None:
        """Whatever it was: makes sure that the robot stands, as far as possible, and says what is known."""
        self.followed.ended = why
        with uninterrupted():
            try:
                self.link.stop()
            except RobotFault as fault:
                self.followed.ended += f"; it was told to stop, but {fault.reason}"
                if self.guard.is_left:
                    self.followed.ended += (
                        "; a process in the background goes on telling it to stop, for an hour or until it does"
                    )
            else:
                self.stands = True
                self.followed.ended += "; it was told to stop and stands"
            with contextlib.suppress(RobotFault, InputError):
                self.take(self.link.samples())

    def finish(self) -> None:
        if self.followed.last is not None:
            last = self.followed.last
            self.passages.take(np.array([last.time_s]), last.q_rad[None], ended=True)


def _why_unable(state: RobotState) -> str:
    if state.robot_mode != RUNNING_MODE and state.safety == "normal":
        return f"the robot stopped: robot mode {MODES.get(state.robot_mode, state.robot_mode)}"
    return f"the robot stopped: {state.safety.replace('_', ' ')}"
