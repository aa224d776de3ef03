"""Trackers behind one small interface: whatever gives lines, in the background, averaged on request."""

from __future__ import annotations

import threading
import time
from collections import deque
from pathlib import Path
from types import TracebackType
from typing import Protocol

import numpy as np

from truepath.errors import InputError
from truepath.recording.lateness import Lateness
from truepath.recording.lines import LineReader
from truepath.recording.readings import BeamBroken, Reading, average
from truepath.recording.sources import FileSource, Source, SourceLost, TcpSource
from truepath.virtual.controller.addresses import TRACKER_PORT

MOST_READINGS_PER_S = 10_000  # the fastest trackers give a few thousand
LEAST_READINGS = 3
PATIENCE_S = 3.0  # beyond the duration asked for, until enough readings have come
POLL_S = 0.01
SPECS = "file:PATH, tcp:HOST:PORT or simulated"

Seen = tuple[float, "tuple[float, ...] | None"]  # moment, and the numbers of a line; None where the beam is broken


class Tracker(Protocol):
    """Looks at the reflector."""

    @property
    def gives_orientation(self) -> bool:
        """Whether readings have an orientation."""

    def reading(self, duration_s: float) -> Reading:
        """The average of what is seen from now on, for so long.

        Raises:
            BeamBroken: the reflector was out of sight meanwhile, or nothing came.
            InputError: what came was not what a tracker says.
        """

    def seen_since(self, start_s: float) -> list[Seen]:
        """Whatever was seen from a moment of ``time.monotonic()`` on, the last few seconds at least."""

    def close(self) -> None: ...


class LineTracker:
    """A tracker that says lines; a context manager.

    Args:
        source: of the lines.
        patience_s: how long the header and late readings are waited for.

    Raises:
        InputError: no header comes.
    """

    def __init__(self, source: Source, patience_s: float = PATIENCE_S) -> None:
        self._source, self._patience_s = source, patience_s
        self._reader, self._lateness = LineReader(source.name), Lateness()
        self._seen: deque[Seen] = deque(maxlen=2 * MOST_READINGS_PER_S)
        self._lock = threading.Lock()
        self._fault: InputError | None = None
        self._lost: str | None = None
        self._columns_have_orientation: bool | None = None
        self._broken = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()
        try:
            self._gives_orientation = self._wait_for_header()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> LineTracker:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def gives_orientation(self) -> bool:
        return self._gives_orientation

    def reading(self, duration_s: float) -> Reading:
        start_s = time.monotonic()
        while True:
            now_s = time.monotonic()
            seen = self.seen_since(start_s)
            if now_s - start_s >= duration_s:
                numbers = [reading for _, reading in seen if reading is not None]
                if self._broken or len(numbers) < len(seen):
                    raise BeamBroken(f"{self._source.name}: the tracker does not see the reflector")
                if len(numbers) >= LEAST_READINGS:
                    return average(np.array(numbers))
                if now_s - start_s >= duration_s + self._patience_s:
                    raise BeamBroken(self._why_nothing())
            time.sleep(POLL_S)

    def seen_since(self, start_s: float) -> list[Seen]:
        self._raise_fault()
        with self._lock:
            return [(moment_s, reading) for moment_s, reading in self._seen if moment_s >= start_s]

    def close(self) -> None:
        self._ended.set()
        self._thread.join()

    def _wait_for_header(self) -> bool:
        end_s = time.monotonic() + self._patience_s
        while (found := self._reader.gives_orientation) is None:
            self._raise_fault()
            if time.monotonic() > end_s:
                expected = "the header of a tracker's lines"
                found_instead = self._lost or f"nothing for {self._patience_s:g} s"
                raise InputError("no tracker", file=self._source.name, expected=expected, found=found_instead)
            time.sleep(POLL_S)
        return found

    def _raise_fault(self) -> None:
        if self._fault is not None:
            raise self._fault

    def _why_nothing(self) -> str:
        if self._lost is not None:
            return self._lost
        with self._lock:
            late_s = time.monotonic() - self._seen[-1][0] if self._seen else None
        if late_s is None:
            return f"{self._source.name}: the tracker is silent"
        return f"{self._source.name}: the newest reading is {late_s:.1f} s old"

    def _listen(self) -> None:
        second, count = 0, 0
        try:
            while not self._ended.is_set():
                try:
                    piece = self._source.read()
                except SourceLost as lost:
                    self._lost = str(lost)
                    self._ended.wait(0.1)
                    continue
                self._lost = None
                if piece.begins:
                    self._reader.restart()
                    self._lateness = Lateness()
                arrived_s = time.monotonic()
                taken = self._take(arrived_s, piece.data)
                self._reader.count_unread(piece.skipped_lines)
                count = taken if int(arrived_s) != second else count + taken
                second = int(arrived_s)
                if count > MOST_READINGS_PER_S:
                    expected = f"{MOST_READINGS_PER_S} a second at most"
                    raise InputError("a flood of readings", file=self._source.name, expected=expected)
        except InputError as fault:
            self._fault = fault
        finally:
            self._source.close()

    def _require_same_columns(self) -> None:
        """A tracker that is started anew begins with a header again: rows of a file must all be of one kind."""
        now = self._reader.gives_orientation
        if self._columns_have_orientation is None:
            self._columns_have_orientation = now
        elif now not in (None, self._columns_have_orientation):
            kinds = {False: "positions", True: "positions and orientations"}
            raise InputError(
                "the tracker has begun anew with other columns",
                file=self._source.name,
                line=1,
                expected=kinds[self._columns_have_orientation],
                found=kinds[now],
            )

    def _take(self, arrived_s: float, data: bytes) -> int:
        """Keeps the readings of some bytes with the moments when they were taken; returns how many."""
        lines = self._reader.feed(data)
        self._require_same_columns()
        if not lines:
            return 0
        clock = np.array([line.numbers[0] for line in lines if line.numbers is not None])
        moments = iter(self._lateness.moments(arrived_s, clock) if len(clock) else ())
        with self._lock:
            for line in lines:
                moment_s = arrived_s if line.numbers is None else float(next(moments))
                self._seen.append((moment_s, line.numbers))
        self._broken = lines[-1].numbers is None
        return len(lines)


def open_tracker(spec: str, robot_host: str) -> LineTracker:
    """The tracker that a specification names.

    Args:
        spec: ``file:PATH``, ``tcp:HOST:PORT``, or ``simulated``: that of the virtual controller.
        robot_host: where the controller is.

    Raises:
        InputError: no such kind of tracker, or it cannot be heard.
    """
    kind, _, place = spec.partition(":")
    if kind == "file" and place:
        return LineTracker(FileSource(Path(place)))
    if spec == "simulated":
        return LineTracker(TcpSource(robot_host, TRACKER_PORT))
    host, _, port = place.rpartition(":")
    if kind == "tcp" and host and port.isascii() and port.isdigit() and 0 < int(port) < 65536:
        return LineTracker(TcpSource(host.strip("[]"), int(port)))
    raise InputError("no such tracker", expected=SPECS, found=spec)
