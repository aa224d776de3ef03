"""The arm of the virtual controller: at any time it is somewhere on its present motion."""

from __future__ import annotations

import asyncio
import logging
import math
import threading
from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array
from truepath.virtual.controller.cartesian import UnreachableError
from truepath.virtual.controller.clock import Clock
from truepath.virtual.controller.kinematics import NominalKinematics
from truepath.virtual.controller.motions import Motion, Rest, SlowingDown

STANDS_RAD_S = 1e-9
MOVED_RAD = 1e-9
BEFORE_THE_END_S = 0.01
REMEMBERED = 32  # stretches: a sample that is sent late is one of when it was due
log = logging.getLogger(__name__)


class Stretch(NamedTuple):
    """A motion under way at one rate; times are the robot's.

    Attributes:
        motion: the motion.
        since_s: when the stretch began.
        elapsed_s: how much of the motion was over by then.
        rate: how fast its time runs.
    """

    motion: Motion
    since_s: float
    elapsed_s: float
    rate: float

    def elapsed(self, time_s: float) -> float:
        """How much of the motion is over."""
        return min(self.elapsed_s + max(time_s - self.since_s, 0.0) * self.rate, self.motion.duration_s)

    @property
    def end_s(self) -> float:
        """When the motion is over."""
        return self.since_s + (self.motion.duration_s - self.elapsed_s) / self.rate

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Joints ``(6,)`` rad and their speeds ``(6,)`` rad/s."""
        q, qd = self.motion.at(self.elapsed(time_s))
        return q, self.rate * qd


class Arm:
    """Drives motions in the robot's time and tells where it is.

    Motions are begun and ended on the event loop; ``sample`` may be asked from other threads.

    Args:
        kinematics: nominal, for limits and paths.
        clock: of the robot.
        q_start_rad: ``(6,)``.

    Attributes:
        lock: held while the arm, or the kinematics, computes.
        approach: ``(6,)`` in {-1, 0, 1}, in which direction each joint travelled last.
        moves: motions that were begun.
        ever_moved: whether a joint has moved at all.
        fault: called with a reason, on the event loop, when the arm cannot go on.
    """

    def __init__(self, kinematics: NominalKinematics, clock: Clock, q_start_rad: Array) -> None:
        self.lock = threading.RLock()
        self.approach = np.zeros(6)
        self.moves, self.ever_moved = 0, False
        self.fault: Callable[[str], None] = log.error
        self._kinematics, self._clock = kinematics, clock
        self._stretch = Stretch(Rest(np.array(q_start_rad, float)), 0.0, 0.0, 1.0)
        self._before: deque[Stretch] = deque(maxlen=REMEMBERED)
        self._last_q = np.array(q_start_rad, float)
        self._timer: asyncio.TimerHandle | None = None
        self._arrived: Callable[[], None] | None = None
        self._marks: deque[tuple[float, Callable[[], None]]] = deque()
        self._failed = False
        self._loop: asyncio.AbstractEventLoop | None = None

    def sample(self, time_s: float | None = None) -> tuple[Array, Array]:
        """Commanded joints ``(6,)`` rad and their speeds ``(6,)`` rad/s, now or a little earlier, robot time."""
        with self.lock:
            now_s = self._clock.now() if time_s is None else time_s
            stretch = self._stretch
            if now_s < stretch.since_s:
                stretch = next((old for old in reversed(self._before) if old.since_s <= now_s), stretch)
            try:
                q, qd = stretch.at(now_s)
            except UnreachableError as error:
                self._fail(str(error))
                return self._last_q, np.zeros(6)
            if (q < self._kinematics.lower_rad - 1e-9).any() or (q > self._kinematics.upper_rad + 1e-9).any():
                self._fail("a joint has come to its limit")
                return self._last_q, np.zeros(6)
            if stretch is self._stretch:
                self._note(q)
            return q, qd

    def begin(
        self,
        motion: Motion,
        arrived: Callable[[], None] | None = None,
        marks: Iterable[tuple[float, Callable[[], None]]] = (),
    ) -> None:
        """Replaces the present motion.

        Args:
            motion: the new one.
            arrived: called when it has ended by itself.
            marks: what else is to be called, and how far into the motion, in order.
        """
        with self.lock:
            self.sample()
            self._loop = asyncio.get_running_loop()
            self.moves += not isinstance(motion, (Rest, SlowingDown))
            self._enter(Stretch(motion, self._clock.now(), 0.0, self.rate))
            self._failed, self._arrived, self._marks = False, arrived, deque(marks)
            self._set_timer()

    def place(self, q_rad: Array) -> None:
        """Puts the arm to joints ``(6,)`` without a motion, as if it had always stood there."""
        with self.lock:
            self._last_q, self._arrived = np.array(q_rad, float), None
            self._enter(Stretch(Rest(self._last_q), self._clock.now(), 0.0, self.rate))
            self._marks.clear()
            self._set_timer()

    def stop(self, deceleration: float, tool: bool = False, arrived: Callable[[], None] | None = None) -> None:
        """Comes to rest along the present way.

        Args:
            deceleration: of the leading joint, rad/s^2, or of the tool, m/s^2.
            tool: which of the two.
            arrived: as of ``begin``.

        Raises:
            InputError: a deceleration that stops nothing.
        """
        if not (math.isfinite(deceleration) and deceleration > 0):
            raise InputError("a stop needs a deceleration", expected="a positive number", found=str(deceleration))
        with self.lock:
            q, qd = self.sample()
            speed = float(np.abs(qd).max())
            if tool:
                speed = float(np.linalg.norm((self._kinematics.jacobian(q, np.eye(4)) @ qd)[3:]))
            motion, elapsed = self._stretch.motion, self._stretch.elapsed(self._clock.now())
            resting = speed < STANDS_RAD_S or self.rate == 0.0
            self.begin(Rest(q) if resting else SlowingDown(motion, elapsed, speed / deceleration), arrived)

    def set_rate(self, rate: float) -> None:
        """How fast motions go, of what they were planned for: the speed slider, or 0 for a pause."""
        with self.lock:
            now_s = self._clock.now()
            self._enter(Stretch(self._stretch.motion, now_s, self._stretch.elapsed(now_s), rate))
            self._set_timer()

    @property
    def rate(self) -> float:
        """See ``set_rate``."""
        return self._stretch.rate

    @property
    def stands(self) -> bool:
        """Whether nothing moves."""
        return bool(np.abs(self.sample()[1]).max() < STANDS_RAD_S)

    def _enter(self, stretch: Stretch) -> None:
        self._before.append(self._stretch)
        self._stretch = stretch

    def _note(self, q: Array) -> None:
        step = q - self._last_q
        moved = np.abs(step) > MOVED_RAD
        self.ever_moved = self.ever_moved or bool(moved.any())
        self.approach = np.where(moved, np.sign(step), self.approach)
        self._last_q = np.where(moved, q, self._last_q)

    def _set_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        following = self._marks[0][0] if self._marks else self._stretch.motion.duration_s
        if self._loop is None or not math.isfinite(following) or self.rate == 0.0:
            return
        left = (following - self._stretch.elapsed(self._clock.now())) / self.rate
        self._timer = self._loop.call_later(max(self._clock.wall_seconds(left), 0.0), self._pass)

    def _pass(self) -> None:
        """A mark, or the end."""
        if not self._marks:
            self._end()
            return
        with self.lock:
            self._timer = None
            _, reached = self._marks.popleft()
            self._set_timer()
        reached()

    def _end(self) -> None:
        with self.lock:
            self._timer = None
            motion = self._stretch.motion
            try:
                for moment in (motion.duration_s - BEFORE_THE_END_S, motion.duration_s):
                    q, _ = motion.at(max(moment, 0.0))
                    self._note(q)
            except UnreachableError as error:
                self._fail(str(error))
                return
            self._enter(Stretch(Rest(q), self._stretch.end_s, 0.0, self.rate))
            arrived, self._arrived = self._arrived, None
        if arrived is not None:
            arrived()

    def _fail(self, reason: str) -> None:
        """Once per motion; the arm stays where it was last, as brakes would hold it."""
        self._enter(Stretch(Rest(self._last_q), self._clock.now(), 0.0, self.rate))
        self._arrived = None
        self._marks.clear()
        if not self._failed and self._loop is not None:
            self._failed = True
            self._loop.call_soon_threadsafe(self.fault, reason)
