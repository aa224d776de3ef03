"""Driving and reading a Universal Robot with the unmodified ``ur_rtde`` client, out of harm's way.

The client holds Python's lock while it connects, blocks for 300 s when a controller dies in a move, and crashes its
process when data stays away for 2.5 s. It therefore lives in child processes, one that reads and one that moves, and
every call here ends in time whatever becomes of them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType

import numpy as np

from truepath.lie import Array
from truepath.robot_link import text_ports
from truepath.robot_link.child_process import Message
from truepath.robot_link.control import Control
from truepath.robot_link.fault import ControlLost, RobotFault
from truepath.robot_link.interruptions import uninterrupted
from truepath.robot_link.reading import Reading
from truepath.robot_link.state import RobotState, from_sample
from truepath.robot_link.stopping import Way, bring_to_rest
from truepath.robot_link.text_ports import STARTS_WITHIN_S, STOP_PROGRAM

RATE_HZ = 125.0
AT_GOAL_RAD = 1e-4
AT_GOAL_M = 1e-4
AT_REST_RAD_S = 0.02
TIMES_AS_LONG = 1.5  # a move may take, besides what the speed slider does to it
SLOWEST_FRACTION = 0.02
START_S = 12.0
STOP_LIMIT_S = 10.0
STOP_ANSWER_S = 1.0  # while a robot moves that is to stop, nothing is waited for for long
STOP_CONTROL_S = 4.0
WATCHED_EVERY_S, SILENCE_S = 0.5, 3.0  # of a move: after such a silence of this process its child ends it
NAMED_WITHIN_S = 0.4  # a safety stop ends the program first, and is named a little later


class RobotLink:
    """A connection to one robot; a context manager. Only a move or ``tcp_offset`` takes control of the robot.

    Args:
        host: address of the controller.
        timeout_s: for how long an answer, a sample or any progress of a move is waited for.
        rate_hz: of the samples.

    Raises (all methods):
        RobotFault: the robot stopped, is lost or does not answer in time.
    """

    def __init__(self, host: str, timeout_s: float = 5.0, rate_hz: float = RATE_HZ) -> None:
        self.host, self.timeout_s = host, timeout_s
        self._reading = Reading(host, rate_hz)
        self._control = Control(host, timeout_s, self._clear)
        self._sent_s: float | None = None
        self._tcp_offset: Array | None = None

    def __enter__(self) -> RobotLink:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def is_reading(self) -> bool:
        """Whether samples are being read; the next one would have to wait for a new connection otherwise."""
        return self._reading.is_on

    @property
    def sent_program_has_begun(self) -> bool:
        """Whether a program has begun to run since ``send_program``."""
        return self._sent_s is None or self._has_begun_before(time.monotonic())

    def _has_begun_before(self, moment_s: float) -> bool:
        began_s = self._reading.first_began_s
        return began_s is not None and began_s < moment_s

    def state(self) -> RobotState:
        """The first sample that arrives after the call: what happened before the call is in it."""
        return self._state(self.timeout_s, max(START_S, self.timeout_s))

    def _state(self, within_s: float, start_s: float) -> RobotState:
        return from_sample(self._reading.newest(within_s, start_s), self._tcp_offset)

    def samples(self) -> list[RobotState]:
        """All samples since the last call, of the last two minutes at most; empty when the robot sends nothing."""
        taken = self._reading.take(max(START_S, self.timeout_s))
        return [from_sample(sample, self._tcp_offset) for sample in taken]

    def move_joints(self, q_rad: Array, speed_rad_s: float, acceleration_rad_s2: float) -> None:
        """Moves linearly in the joints; returns when the controller has reached the goal ``(6,)`` and stands."""
        goal = np.asarray(q_rad, float)
        distance = float(np.abs(goal - self.state().q_target_rad).max())
        self._move(
            {"do": "move_joints", "to": goal.tolist(), "speed": speed_rad_s, "acceleration": acceleration_rad_s2},
            lambda state: bool(np.abs(state.q_target_rad - goal).max() < AT_GOAL_RAD),
            duration_of_move(distance, speed_rad_s, acceleration_rad_s2),
        )

    def move_line(self, tcp_pose: Array, speed_m_s: float, acceleration_m_s2: float) -> None:
        """Moves the tool along a line to ``(6,)`` x, y, z (m), rotation vector (rad); returns when it stands there."""
        goal = np.asarray(tcp_pose, float)
        distance = float(np.linalg.norm(goal[:3] - self.state().tcp_pose[:3]))
        self._move(
            {"do": "move_line", "to": goal.tolist(), "speed": speed_m_s, "acceleration": acceleration_m_s2},
            lambda state: bool(np.abs(state.tcp_pose[:3] - goal[:3]).max() < AT_GOAL_M),
            duration_of_move(distance, speed_m_s, acceleration_m_s2) + 2.0 * np.pi,  # a tool may turn on the spot
        )

    def tcp_offset(self) -> Array:
        """``(6,)`` tool on the flange as set on the controller. Takes control: a running program ends.

        Raises:
            ControlLost: control was held and is lost.
        """
        self._control.require(self._reading.plays_since_s)
        self._tcp_offset = np.array(self._control.ask({"do": "tcp_offset"}, self.timeout_s), float)
        return self._tcp_offset

    def stop(self) -> None:
        """Stops the robot by every way there is, until it is seen to stand and no program runs on it.

        A program that was sent and has not been seen to begin is waited for, and stopped when it does. Signals that
        would interrupt are nothing meanwhile; it takes a limited time.

        Raises:
            RobotFault: it was not seen to come to rest; says what is known.
        """
        dashboard: Way = ("dashboard", self._stop_by_dashboard)
        script: Way = ("script port", self._stop_by_program)
        control: Way = ("control script", self._stop_by_control)
        if self._control.is_on:
            ways = [control, dashboard, script]
        elif self.sent_program_has_begun:
            ways = [dashboard, script, control]
        else:  # it comes by that port: what is sent there now comes after it, as a rule
            ways = [script, dashboard]
        asked_s = time.monotonic()  # what begins later may be the program that stops

        def may_start() -> bool:
            until_s = 0.0 if self._sent_s is None else self._sent_s + STARTS_WITHIN_S
            return time.monotonic() < until_s and not self._has_begun_before(asked_s)

        with uninterrupted():
            bring_to_rest(self._look, ways, STOP_LIMIT_S, may_start)
            self._sent_s = None

    def _clear(self, late_s: float) -> None:
        """Sees that a script which may be on its way does not stay."""
        ways: list[Way] = [("script port", self._stop_by_program), ("dashboard", self._stop_by_dashboard)]
        until_s = time.monotonic() + late_s
        bring_to_rest(self._look, ways, late_s, lambda: time.monotonic() < until_s)

    def _look(self) -> RobotState:
        try:
            return self._state(STOP_ANSWER_S, STOP_CONTROL_S)
        except RobotFault:
            self._reading.close()  # it may be its fault: the next look is by another
            raise

    def _stop_by_dashboard(self) -> str:
        return text_ports.ask_dashboard(self.host, "stop", STOP_ANSWER_S)

    def _stop_by_program(self) -> str:
        text_ports.send_program(self.host, STOP_PROGRAM, STOP_ANSWER_S)
        return ""

    def _stop_by_control(self) -> str:
        """Takes control if this link has none: what runs on the robot is replaced. Gives it back, either way."""
        try:
            self._control.take(1, STOP_CONTROL_S)
            self._control.ask({"do": "stop"}, STOP_CONTROL_S)
        finally:
            self._control.give_back()
        return ""

    def send_program(self, text: str) -> None:
        """Sends a URScript program to the controller, which starts it at once, or a little later."""
        self.give_control_back()
        self.state()  # a robot that cannot be seen gets none
        self._reading.expect_program()
        self._sent_s = time.monotonic()
        text_ports.send_program(self.host, text, self.timeout_s)

    def give_control_back(self) -> None:
        """Ends the control script of this link, if there is one; it may be taken anew."""
        self._control.give_back()

    def dashboard(self, question: str) -> str:
        """The answer of the dashboard, one line."""
        return text_ports.ask_dashboard(self.host, question, self.timeout_s)

    def close(self) -> None:
        """Ends both children. A robot that moves by order of this link stops."""
        self.give_control_back()
        self._reading.close()

    def _move(self, request: Message, is_there: Callable[[RobotState], bool], duration_s: float) -> None:
        before = self.state()
        if not before.able_to_move:
            raise RobotFault(_unable(before))
        self._control.require(self._reading.plays_since_s)
        before = self.state()  # by now it is known when the control script has begun
        program_began_s = self._reading.began_s
        try:
            if self._control.ask({**request, "silence_s": SILENCE_S}, self.timeout_s) is not True:
                raise self._why_not_playing() or RobotFault(f"the robot refuses to move; {_unable(self.state())}")
            self._follow_move(before, program_began_s, is_there, duration_s)
            self._control.tell({"do": "arrived"})
        except ControlLost:  # what runs there is not ours
            raise
        except BaseException as error:  # Ctrl-C too: whatever happened, nobody is watching this move any more
            with uninterrupted():
                known = self._stopped()
            if isinstance(error, RobotFault):
                raise RobotFault(f"{error.reason}; {known}") from None
            if isinstance(error, KeyboardInterrupt):
                raise KeyboardInterrupt(known) from None
            raise

    def _stopped(self) -> str:
        """Stops the robot; what is then known of it."""
        try:
            self.stop()
        except RobotFault as fault:
            return f"it was told to stop, but {fault.reason}"
        finally:
            self.give_control_back()
        return "it was told to stop and stands"

    def _follow_move(
        self,
        state: RobotState,
        program_began_s: float | None,
        is_there: Callable[[RobotState], bool],
        duration_s: float,
    ) -> None:
        began_s = moved_s = told_s = time.monotonic()
        while True:
            previous, state = state, self.state()
            now_s = time.monotonic()
            if not state.able_to_move:
                raise RobotFault(_unable(state))
            if is_there(state) and np.abs(state.speed_rad_s).max() < AT_REST_RAD_S:
                return
            if np.abs(state.q_target_rad - previous.q_target_rad).max() > 0.0:
                moved_s = now_s
            if not self._control.is_on:
                raise RobotFault(self._control.last_words())
            if now_s - told_s > WATCHED_EVERY_S:
                self._control.tell({"do": "watched"})
                told_s = now_s
            if self._reading.began_s != program_began_s:
                raise self._control.why_lost()
            if not state.program_running and (why := self._why_not_playing()) is not None:
                raise why
            if now_s - moved_s > self.timeout_s:
                if state.program_plays and (why := self._control.why_silent()) is not None:
                    raise why
                raise RobotFault(f"the robot has stood short of its goal for {self.timeout_s:.1f} s")
            allowed_s = TIMES_AS_LONG * duration_s / max(state.speed_fraction, SLOWEST_FRACTION) + self.timeout_s
            if now_s - began_s > allowed_s:
                raise RobotFault(f"a move of {duration_s:.1f} s has not ended after {allowed_s:.1f} s")

    def _why_not_playing(self) -> RobotFault | None:
        """Why the control script does not run any more; None if it does."""
        end_s = time.monotonic() + NAMED_WITHIN_S
        while time.monotonic() < end_s:
            state = self.state()
            if not state.able_to_move:
                return RobotFault(_unable(state))
            if state.program_plays:
                return None
        return self._control.why_lost()


def duration_of_move(distance: float, speed: float, acceleration: float) -> float:
    """Seconds that a move from rest to rest takes: distance rad or m, speed and acceleration of the same length."""
    if distance * acceleration <= speed**2:
        return float(2.0 * np.sqrt(distance / acceleration))
    return distance / speed + speed / acceleration


def _unable(state: RobotState) -> str:
    return f"safety status {state.safety.replace('_', ' ')}, robot mode {state.robot_mode}"
