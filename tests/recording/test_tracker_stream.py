"""The simulated tracker: what it says is what the line protocol knows, and nobody who listens badly disturbs it."""

import itertools
import socket
import threading
import time

import numpy as np
import pytest
from truepath.errors import InputError
from truepath.recording.lines import LineReader
from truepath.recording.readings import BeamBroken
from truepath.recording.trackers import open_tracker
from truepath.virtual.controller.tracker_stream import MOST_LISTENERS, Sight, TrackerStream

ADDRESS = "127.0.2.94"
PLACE_M = np.array([1.25, -0.5, 0.125])


class Scene:
    """What there is to see; a test changes it."""

    def __init__(self):
        self.visible = True

    def look(self):
        return Sight(time.monotonic(), PLACE_M, self.visible)


@pytest.fixture
def scene():
    return Scene()


@pytest.fixture
def stream(scene):
    with TrackerStream(ADDRESS, 0, scene.look, rate_hz=200.0) as stream:
        yield stream


def said(stream, lines):
    with socket.create_connection((ADDRESS, stream.port), 2.0) as connection:
        data = b""
        while data.count(b"\n") < lines:
            data += connection.recv(1000)
        return data


def test_every_line_is_one_of_the_protocol(stream):
    data = said(stream, 20)
    assert data.startswith(b"t_s,x_mm,y_mm,z_mm\n")
    readings = LineReader("stream").feed(data)
    assert all(reading.numbers[1:] == (1250.0, -500.0, 125.0) for reading in readings)
    clock = [reading.numbers[0] for reading in readings]
    assert all(0 < after - before < 0.1 for before, after in itertools.pairwise(clock))


def test_a_broken_beam_is_said_once_to_everybody(stream, scene):
    scene.visible = False
    with socket.create_connection((ADDRESS, stream.port), 2.0) as connection:
        time.sleep(0.1)
        assert connection.recv(1000) == b"t_s,x_mm,y_mm,z_mm\nbeam_break\n"
        scene.visible = True
        time.sleep(0.05)
        assert connection.recv(1000).count(b",1250.000000,") > 2


def test_the_recorder_hears_the_stream(stream, scene):
    with open_tracker(f"tcp:{ADDRESS}:{stream.port}", "-") as tracker:
        assert np.allclose(tracker.reading(0.1).p_ME, PLACE_M)
        scene.visible = False
        time.sleep(0.05)
        with pytest.raises(BeamBroken):
            tracker.reading(0.05)
        scene.visible = True
        time.sleep(0.05)
        assert np.allclose(tracker.reading(0.1).p_ME, PLACE_M)


def test_who_speaks_is_disconnected_and_nobody_else_is(stream):
    with (
        socket.create_connection((ADDRESS, stream.port), 2.0) as rude,
        socket.create_connection((ADDRESS, stream.port), 2.0) as polite,
    ):
        rude.sendall(b"\x00\xff" * 5000)
        end = time.monotonic() + 2.0
        with pytest.raises(ConnectionError):  # noqa: PT012 - the reset comes after some readings
            while time.monotonic() < end:
                if not rude.recv(1000):
                    raise ConnectionResetError
        polite.recv(10_000)
        assert polite.recv(1000)


def test_more_listeners_than_there_is_room_for_are_sent_away(stream):
    crowd = [socket.create_connection((ADDRESS, stream.port), 2.0) for _ in range(MOST_LISTENERS + 5)]
    time.sleep(0.1)
    answers = [connection.recv(5) for connection in crowd]
    for connection in crowd:
        connection.close()
    assert answers.count(b"") == 5
    assert said(stream, 3)


def test_it_ends_and_frees_its_port(scene):
    threads = threading.active_count()
    stream = TrackerStream(ADDRESS, 0, scene.look)
    stream.close()
    assert threading.active_count() == threads
    with TrackerStream(ADDRESS, stream.port, scene.look):
        pass


def test_only_this_machine_is_served_and_a_port_once(stream, scene):
    for address in ("0.0.0.0", "192.168.0.1", "localhost", ""):
        with pytest.raises(InputError, match="this machine only"):
            TrackerStream(address, 0, scene.look)
    with pytest.raises(InputError, match="cannot be opened"):
        TrackerStream(ADDRESS, stream.port, scene.look)
