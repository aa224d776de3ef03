"""How late a tracker is, from readings and joints made by hand: one joint turns, the reflector goes along."""

import time

import numpy as np
import pytest
from truepath.plants import load_robot
from truepath.recording.departures import Departures
from truepath.robot_link import RobotFault, RobotState

ROBOT = load_robot("ur5")
START_RAD = np.array([0.0, -1.57, 1.57, -1.57, -1.57, 0.0])
SPEED_RAD_S = 0.5


class Heard:
    """A tracker that has heard these readings, (moment, (t, x, y, z in mm)) or (moment, None)."""

    gives_orientation = False

    def __init__(self, readings):
        self.readings = readings

    def seen_since(self, start_s):
        return [reading for reading in self.readings if reading[0] >= start_s]


def state(arrived_s, joint_1_rad):
    q = START_RAD + np.array([joint_1_rad, 0, 0, 0, 0, 0])
    zero = np.zeros(6)
    return RobotState(0.0, arrived_s, q, q, zero, zero, zero, 7, "normal", True)


def look(late_s, without=(9.0, 9.0), broken_at_s=None, turn_rad=0.3):
    """The robot leaves half a second from when it was asked whether it stands; the tracker tells so much later."""
    tracker = Heard([])
    departures = Departures(tracker, ROBOT, 0.5)
    now_s = time.monotonic()
    tracker.readings = [(now_s + 0.01 * (k + 1), (0.0, 0.0, 0.0, 0.0)) for k in range(3)]
    departures.robot_stands()
    left_s = departures._stood_s + 0.5
    angle = lambda t: np.clip(SPEED_RAD_S * (t - left_s), 0.0, turn_rad)  # noqa: E731
    samples = [state(t, angle(t)) for t in left_s + np.arange(-0.1, 1.0, 0.008)]
    noise = np.random.default_rng(0)
    for t in left_s + np.arange(-0.9, 6.0, 0.01):
        if not without[0] < t - left_s < without[1]:
            x_mm = 1e3 * 0.5 * angle(t - late_s)
            tracker.readings.append((t, (t, *(np.array([x_mm, 0.0, 0.0]) + noise.normal(0, 0.02, 3)))))
    if broken_at_s is not None:
        tracker.readings.append((left_s + broken_at_s, None))
    departures.look(samples)
    return departures.delay_s


@pytest.mark.parametrize("late_s", [0.0, 0.4, 3.0, 4.5])
def test_how_late_the_readings_are_is_found(late_s):
    assert look(late_s) == pytest.approx(late_s, abs=0.05)


@pytest.mark.parametrize("late_s", [7.0, np.inf])
def test_readings_that_show_nothing_of_a_move_are_refused(late_s):
    with pytest.raises(RobotFault, match="shows nothing of a move"):
        look(late_s)


def test_a_move_that_hardly_moves_the_flange_need_not_be_seen():
    assert look(np.inf, turn_rad=0.005) == 0.0


def test_a_broken_beam_says_nothing_of_the_delay():
    assert look(3.0, broken_at_s=0.1) == 0.0


def test_a_gap_in_the_readings_says_nothing_of_the_delay():
    assert look(0.0, without=(-0.05, 1.0)) == 0.0
