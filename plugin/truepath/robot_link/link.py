"""Driving and reading a Universal Robot with the unmodified ``ur_rtde`` client, out of harm's way.

The client holds Python's lock while it connects, blocks for 300 s when a controller dies in a move, and crashes its
process when data stays away for 2.5 s. It therefore lives in child processes, one that reads and one that moves, and
every call here ends in time whatever becomes of them.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from types import TracebackType
from typing import Any

import numpy as np

from truepath.lie import Array
from truepath.robot_link import text_ports
from truepath.robot_link.child_process import ChildProcess, Message, wait_for
from truepath.robot_link.fault import RobotFault
from truepath.robot_link.interruptions import deferred, uninterrupted
from truepath.robot_link.state import RobotState, from_sample
from truepath.robot_link.stopping import STOP_PROGRAM, Way, bring_to_rest

RATE_HZ = 125.0
UNREAD_SAMPLES = int(120 * RATE_HZ)
AT_GOAL_RAD = 1e-4
AT_GOAL_M = 1e-4
AT_REST_RAD_S = 0.02
TIMES_AS_LONG = 1.5  # a move may take, besides what the speed slider does to it
SLOWEST_FRACTION = 0.02
STARTS_TRIED = 3
POLL_S = 0.002
START_S = 12.0  # the client uploads its script and waits for it to run
STOP_LIMIT_S = 10.0
STOP_ANSWER_S = 1.0  # while a robot moves that is to stop, nothing is waited for for long
STOP_CONTROL_S = 4.0


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
        self.host, self.timeout_s, self._rate_hz = host, timeout_s, rate_hz
        self._samples: deque[Message] = deque(maxlen=UNREAD_SAMPLES)
        self._lock = threading.Lock()
        self._newest: Message | None = None
        self._fault: str | None = None
        self._reading: ChildProcess | None = None
        self._control: ChildProcess | None = None
        self._tcp_offset: Array | None = None

    def __enter__(self) -> RobotLink:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def state(self) -> RobotState:
        """The first sample that arrives after the call: what happened before the call is in it."""
        return self._state(self.timeout_s, max(START_S, self.timeout_s))

    def _state(self, within_s: float, start_s: float) -> RobotState:
        self._start_reading(start_s)
        asked_s = time.monotonic()
        if not wait_for(lambda: self._is_after(asked_s) or self._is_lost(), within_s, POLL_S) or self._is_lost():
            raise RobotFault(f"{self.host}: {self._fault or f'no data from the robot for {within_s:.1f} s'}")
        assert self._newest is not None
        return from_sample(self._newest, self._tcp_offset)

    def samples(self) -> list[RobotState]:
        """All samples since the last call, of the last two minutes at most; empty when the robot sends nothing."""
        self._start_reading(max(START_S, self.timeout_s))
        with self._lock:
            taken = list(self._samples)
            self._samples.clear()
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
        """``(6,)`` tool on the flange as set on the controller. Takes control: a running program ends."""
        self._tcp_offset = np.array(self._ask({"do": "tcp_offset"}, self.timeout_s), float)
        return self._tcp_offset

    def stop(self) -> None:
        """Stops the robot by every way there is, until it is seen to stand and no program runs on it.

        Signals that would interrupt are nothing meanwhile; it takes a limited time.

        Raises:
            RobotFault: it was not seen to come to rest; says what is known.
        """
        text_ways: list[Way] = [("dashboard", self._stop_by_dashboard), ("script port", self._stop_by_program)]
        control: Way = ("control script", self._stop_by_control)
        is_in_control = self._control is not None and self._control.alive
        ways = [control, *text_ways] if is_in_control else [*text_ways, control]
        with uninterrupted():
            bring_to_rest(lambda: self._state(STOP_ANSWER_S, STOP_CONTROL_S), ways, STOP_LIMIT_S)

    def _stop_by_dashboard(self) -> str:
        return text_ports.ask_dashboard(self.host, "stop", STOP_ANSWER_S)

    def _stop_by_program(self) -> str:
        text_ports.send_program(self.host, STOP_PROGRAM, STOP_ANSWER_S)
        return ""

    def _stop_by_control(self) -> str:
        """Takes control if this link has none: what runs on the robot is replaced. Gives it back, either way."""
        try:
            self._start_control(1, STOP_CONTROL_S)
            self._ask({"do": "stop"}, STOP_CONTROL_S)
        finally:
            self._end_control()
        return ""

    def send_program(self, text: str) -> None:
        """Sends a URScript program to the controller, which starts it at once."""
        self._end_control()
        text_ports.send_program(self.host, text, self.timeout_s)

    def dashboard(self, question: str) -> str:
        """The answer of the dashboard, one line."""
        return text_ports.ask_dashboard(self.host, question, self.timeout_s)

    def close(self) -> None:
        """Ends both children. A robot that moves by order of this link stops."""
        self._end_control()
        if self._reading is not None:
            self._reading.kill()
            self._reading = None

    def _move(self, request: Message, is_there: Any, duration_s: float) -> None:
        before = self.state()
        if not before.able_to_move:
            raise RobotFault(_unable(before))
        try:
            if self._ask(request, self.timeout_s) is not True:
                # The client's script has ended meanwhile, by a stop that is over or another program: once more, anew.
                self._end_control()
                if self._ask(request, self.timeout_s) is not True:
                    raise RobotFault(f"the robot refuses to move; {_unable(self.state())}")
            self._follow_move(before, is_there, duration_s)
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
            self._end_control()
        return "it was told to stop and stands"

    def _follow_move(self, state: RobotState, is_there: Any, duration_s: float) -> None:
        began_s = moved_s = time.monotonic()
        while True:
            previous, state = state, self.state()
            now_s = time.monotonic()
            if not state.able_to_move:
                raise RobotFault(_unable(state))
            if is_there(state) and np.abs(state.speed_rad_s).max() < AT_REST_RAD_S:
                return
            if np.abs(state.q_target_rad - previous.q_target_rad).max() > 0.0:
                moved_s = now_s
            if self._control is None or not self._control.alive:
                raise RobotFault(self._control.last_words() if self._control else "the link was closed in a move")
            if now_s - moved_s > self.timeout_s:
                raise RobotFault(f"the robot has stood short of its goal for {self.timeout_s:.1f} s")
            allowed_s = TIMES_AS_LONG * duration_s / max(state.speed_fraction, SLOWEST_FRACTION) + self.timeout_s
            if now_s - began_s > allowed_s:
                raise RobotFault(f"a move of {duration_s:.1f} s has not ended after {allowed_s:.1f} s")

    def _ask(self, request: Message, timeout_s: float) -> Any:
        control = self._start_control()
        try:
            control.send(request)
            return control.answer(timeout_s, str(request["do"]).replace("_", " "))
        except RobotFault:
            self._end_control()
            raise

    def _start_control(self, tries: int = STARTS_TRIED, patience_s: float | None = None) -> ChildProcess:
        if self._control is not None and self._control.alive:
            return self._control
        for attempt in range(tries):
            control = ChildProcess("truepath.robot_link.control_child", [self.host])
            try:
                control.answer(patience_s or max(START_S, self.timeout_s), "taking control of the robot")
                self._control = control
                return control
            except RobotFault:
                # A client that has just been killed may still hold the controller's registers.
                self._abandon(control)
                if attempt == tries - 1:
                    raise
                time.sleep(0.5)
            except BaseException:
                self._abandon(control)
                raise
        raise AssertionError("unreachable")

    def _abandon(self, control: ChildProcess) -> None:
        """Ends a client that has not come so far as to answer. What it has sent meanwhile must not stay there."""
        with deferred():
            gave_up_itself = control.gave_up_itself
            control.kill()
            if not gave_up_itself:  # else nothing was sent, and what runs on the robot is not ours
                with contextlib.suppress(RobotFault):
                    self._stop_by_program()

    def _end_control(self) -> None:
        control, self._control = self._control, None
        if control is not None:
            with deferred():
                with contextlib.suppress(RobotFault):
                    control.send({"do": "close"})
                control.close()

    def _start_reading(self, start_s: float) -> None:
        if self._reading is not None and self._reading.alive:
            return
        self._newest, self._fault = None, None
        arguments = [self.host, str(self._rate_hz)]
        self._reading = ChildProcess("truepath.robot_link.reading_child", arguments, self._receive)
        if not wait_for(lambda: self._newest is not None or self._is_lost(), start_s):
            self._reading.kill()
            raise RobotFault(f"{self.host} does not answer: no data within {start_s:.0f} s")
        if self._is_lost():
            raise RobotFault(f"{self.host} cannot be read: {self._fault or self._reading.last_words()}")

    def _receive(self, message: Message) -> None:
        if "error" in message:
            self._fault = str(message["error"])
        for sample in message.get("samples", ()):
            with self._lock:
                self._samples.append(sample)
            self._newest = sample

    def _is_after(self, moment_s: float) -> bool:
        return self._newest is not None and self._newest["arrived_s"] > moment_s

    def _is_lost(self) -> bool:
        return self._fault is not None or self._reading is None or not self._reading.alive


def duration_of_move(distance: float, speed: float, acceleration: float) -> float:
    """Seconds that a move from rest to rest takes: distance rad or m, speed and acceleration of the same length."""
    if distance * acceleration <= speed**2:
        return float(2.0 * np.sqrt(distance / acceleration))
    return distance / speed + speed / acceleration


def _unable(state: RobotState) -> str:
    return f"safety status {state.safety.replace('_', ' ')}, robot mode {state.robot_mode}"
