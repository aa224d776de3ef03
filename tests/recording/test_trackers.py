"""Trackers over TCP and from files: what is averaged, what is refused, and that nothing hangs or grows."""

import itertools
import threading
import time

import numpy as np
import pytest
from served import server, speaking
from truepath.errors import InputError
from truepath.recording.readings import BeamBroken
from truepath.recording.sources import FileSource, TcpSource
from truepath.recording.trackers import LineTracker, open_tracker

HEADER = b"t_s,x_mm,y_mm,z_mm\n"


def line(t_s, x_mm=1.0):
    return f"{t_s:.6f},{x_mm},2,3\n".encode()


def now(x_mm=1.0, late_s=0.0):
    """A reading of this moment by a tracker whose clock shows another time."""
    return line(time.monotonic() - late_s + 1e6, x_mm)


def ticking(x_mm=1.0, rate_hz=200.0):
    def tick(connection):
        while True:
            connection.sendall(now(x_mm))
            time.sleep(1.0 / rate_hz)

    return tick


def impatient(spec):
    _, host, port = spec.split(":")
    return LineTracker(TcpSource(host, int(port)), patience_s=0.2)


class Writer:
    """Appends a reading to a file every few milliseconds, as another program would."""

    def __init__(self, path, x_mm=1.0):
        self.path, self.x_mm, self.paused = path, x_mm, False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._write)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()

    def _write(self):
        while not self._ended.wait(0.004):
            if not self.paused:
                with self.path.open("ab") as file:
                    file.write(now(self.x_mm))


def test_a_stream_is_averaged_over_the_time_asked_for():
    with server(speaking(HEADER, then=ticking())) as spec, open_tracker(spec, "-") as tracker:
        begin = time.monotonic()
        reading = tracker.reading(0.3)
        assert 0.3 <= time.monotonic() - begin < 0.6
    assert np.allclose(reading.p_ME, [1e-3, 2e-3, 3e-3])
    assert 20 < reading.count <= 62
    assert tracker.gives_orientation is False


def test_readings_from_before_the_question_do_not_count():
    place = itertools.chain([1.0] * 40, itertools.repeat(9.0))

    def moving(connection):
        for x_mm in place:
            connection.sendall(now(x_mm))
            time.sleep(0.005)

    with server(speaking(HEADER, then=moving)) as spec, open_tracker(spec, "-") as tracker:
        time.sleep(0.4)
        reading = tracker.reading(0.1)
    assert np.isclose(reading.p_ME[0], 9e-3)
    assert reading.spread_mm < 1e-9


def test_readings_that_were_kept_back_do_not_count():
    """A program that writes its buffer when it is full: what it writes now was measured at the pose before."""

    def keeping_back(connection):
        connection.sendall(now())
        time.sleep(0.7)
        while True:
            connection.sendall(now(late_s=0.6))
            time.sleep(0.005)

    with server(speaking(HEADER, then=keeping_back)) as spec, impatient(spec) as tracker:
        time.sleep(0.8)
        with pytest.raises(BeamBroken, match=r"newest reading is 0\.[67] s old"):
            tracker.reading(0.2)


def test_a_broken_beam_is_told_and_comes_back():
    broken, back = threading.Event(), threading.Event()

    def breaking(connection):
        for _ in range(20):
            connection.sendall(now())
        connection.sendall(b"beam_break\n")
        broken.set()
        back.wait()
        ticking(5.0)(connection)

    with server(speaking(HEADER, then=breaking)) as spec, open_tracker(spec, "-") as tracker:
        broken.wait()
        with pytest.raises(BeamBroken, match="does not see the reflector"):
            tracker.reading(0.1)
        back.set()
        time.sleep(0.1)
        assert np.isclose(tracker.reading(0.1).p_ME[0], 5e-3)


def test_a_beam_that_breaks_while_it_is_read_spoils_the_reading():
    def blinking(connection):
        for k in range(1000):
            connection.sendall(b"beam_break\n" if k == 30 else now())
            time.sleep(0.005)

    with server(speaking(HEADER, then=blinking)) as spec, open_tracker(spec, "-") as tracker, pytest.raises(BeamBroken):
        tracker.reading(0.4)


def test_a_connection_that_is_lost_is_made_anew():
    visits = itertools.count()

    def short(connection):
        connection.sendall(HEADER)
        place = float(next(visits))
        for _ in range(10 if place == 0 else 10_000):
            connection.sendall(now(place))
            time.sleep(0.005)

    with server(short) as spec, open_tracker(spec, "-") as tracker:
        time.sleep(0.5)
        assert np.isclose(tracker.reading(0.1).p_ME[0], 1e-3)


def test_a_tracker_that_comes_back_with_other_columns_is_refused():
    """Rows of another width, from a 6D probe where there was a reflector, would spoil the file."""
    visits = itertools.count()

    def other(connection):
        is_first = next(visits) == 0
        connection.sendall(HEADER if is_first else b"t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n")
        for _ in range(40 if is_first else 10_000):
            connection.sendall(now() if is_first else now().replace(b"\n", b",1,0,0,0\n"))
            time.sleep(0.005)

    with server(other) as spec, open_tracker(spec, "-") as tracker:
        with pytest.raises(InputError, match="begun anew with other columns") as error:
            tracker.reading(0.6)
        assert error.value.expected == "positions"


def test_a_silent_tracker_is_told_within_the_patience():
    with server(speaking(HEADER, line(1.0))) as spec, impatient(spec) as tracker:
        begin = time.monotonic()
        with pytest.raises(BeamBroken):
            tracker.reading(0.1)
        assert time.monotonic() - begin < 0.6


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"x" * 100_000, "without end"),
        (HEADER + b"\xff\xfe\n", "not UTF-8"),
        (HEADER + b"1,nan,2,3\n", "not a finite number"),
        (HEADER + b"1,2\n", "wrong number of columns"),
        (HEADER + b"\x00" * 1000, "without end"),
        (b"HTTP/1.1 200 OK\r\n", "no header"),
        (HEADER + line(1.0) * 30_000, "a flood of readings"),
        (HEADER + b"beam_break\n" * 30_000, "a flood of readings"),
    ],
)
def test_hostile_bytes_end_in_an_error_that_says_what_was_expected(data, problem):
    begin = time.monotonic()
    with server(speaking(data)) as spec, pytest.raises(InputError, match=problem) as error:
        heard(spec)
    assert time.monotonic() - begin < 3.0
    assert error.value.expected


def heard(spec):
    with open_tracker(spec, "-") as tracker:
        time.sleep(0.1)
        return tracker.reading(0.4)


def test_who_says_nothing_is_no_tracker():
    with server(speaking()) as spec, pytest.raises(InputError, match="no tracker"):
        impatient(spec)


@pytest.mark.parametrize("spec", ["", "laser", "tcp:", "tcp:host", "tcp:host:99999", "tcp::5", "file:", "simulated:1"])
def test_a_tracker_that_is_not_known_is_refused(spec):
    with pytest.raises(InputError, match="no such tracker"):
        open_tracker(spec, "127.0.0.1")


class TestFile:
    @pytest.fixture
    def path(self, tmp_path):
        """A file of yesterday, which ends within a line."""
        path = tmp_path / "tracker.csv"
        path.write_bytes(HEADER + b"".join(line(k, 77.0) for k in range(2000)) + b"2000.0,77")
        return path

    def test_what_was_there_before_does_not_count_and_half_a_line_is_finished(self, path):
        with path.open("ab") as file:
            file.write(b",2,3\n")
        with Writer(path), open_tracker(f"file:{path}", "-") as tracker:
            reading = tracker.reading(0.15)
        assert np.allclose(reading.p_ME, [1e-3, 2e-3, 3e-3])

    def test_an_error_names_the_line_as_an_editor_counts(self, path):
        with open_tracker(f"file:{path}", "-") as tracker:
            with path.open("ab") as file:
                file.write(b",2,3\n3000,1,2\n")
            with pytest.raises(InputError, match="wrong number of columns") as error:
                tracker.reading(0.2)
        assert error.value.line == 2003  # header, 2000 rows, the one that was finished

    def test_a_file_that_is_begun_anew_is_followed(self, path):
        path.write_bytes(HEADER)
        with open_tracker(f"file:{path}", "-") as tracker:
            with Writer(path, 4.0):
                assert np.isclose(tracker.reading(0.1).p_ME[0], 4e-3)
            path.write_bytes(HEADER)  # truncated
            with Writer(path, 5.0):
                assert np.isclose(tracker.reading(0.1).p_ME[0], 5e-3)
            path.rename(path.with_suffix(".old"))  # rotated
            time.sleep(0.05)
            path.write_bytes(HEADER)
            time.sleep(0.15)
            with Writer(path, 6.0):
                assert np.isclose(tracker.reading(0.1).p_ME[0], 6e-3)

    def test_a_header_may_come_later(self, tmp_path):
        path = tmp_path / "new.csv"
        path.write_bytes(b"t_s,x_")
        timer = threading.Timer(0.2, lambda: path.write_bytes(HEADER + now()))
        timer.start()
        with open_tracker(f"file:{path}", "-"), Writer(path):
            pass
        timer.join()

    @pytest.mark.parametrize("name", ["missing.csv", "."])
    def test_what_is_no_file_is_refused(self, tmp_path, name):
        with pytest.raises(InputError, match="file"):
            FileSource(tmp_path / name)

    def test_a_large_old_file_is_passed_over_quickly(self, tmp_path):
        path = tmp_path / "large.csv"
        path.write_bytes(HEADER + line(1.0) * 3_000_000)
        begin = time.monotonic()
        with open_tracker(f"file:{path}", "-") as tracker:
            assert time.monotonic() - begin < 1.5
            assert len(tracker._seen) == 0
