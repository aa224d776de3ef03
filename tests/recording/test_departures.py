"""How late a tracker is, from readings and joints made by hand: one joint turns, the reflector goes along."""

import numpy as np
import pytest
from truepath.plants import load_robot
from truepath.recording.departures import LATEST_S, Departures
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


def look(late_s, without=(9.0, 9.0), broken_at_s=None, turn_rad=0.3, hz=100.0, times=1):
    """The robot leaves half a second after it was said to; the tracker tells so much later."""
    tracker = Heard([])
    departures = Departures(tracker, ROBOT)
    for _ in range(times):
        one_move(departures, tracker, late_s, without, broken_at_s, turn_rad, hz)
    return departures.delay_s


def one_move(departures, tracker, late_s, without, broken_at_s, turn_rad, hz):
    shown_s = 0.4 + 4.0 / hz  # for which a pose is measured, and the tracker shows the robot standing
    tracker.readings = []
    departures.tracker_shows_standing()
    departures._shown_since_s -= shown_s
    departures.robot_leaves()
    left_s = departures._stood_s + 0.5
    angle = lambda t: np.clip(SPEED_RAD_S * (t - left_s), 0.0, turn_rad)  # noqa: E731
    samples = [state(t, angle(t)) for t in left_s + np.arange(-0.1, 1.0, 0.008)]
    noise = np.random.default_rng(0)
    for t in left_s + np.arange(-0.5 - shown_s, 8.0, 1.0 / hz):
        if not without[0] < t - left_s < without[1]:
            x_mm = 1e3 * 0.5 * angle(t - late_s)
            tracker.readings.append((t, (t, *(np.array([x_mm, 0.0, 0.0]) + noise.normal(0, 0.02, 3)))))
    if broken_at_s is not None:
        tracker.readings.append((left_s + broken_at_s, None))
        tracker.readings.sort(key=lambda reading: reading[0])
    departures.look(samples)


@pytest.mark.parametrize("late_s", [0.0, 0.4, 3.0, 4.5])
def test_how_late_the_readings_are_is_found(late_s):
    assert look(late_s) == pytest.approx(late_s, abs=0.05)


@pytest.mark.parametrize(("late_s", "hz"), [(0.0, 3.0), (4.0, 3.0), (1.0, 1.5), (4.0, 5.0)])
def test_how_late_readings_are_that_come_seldom_is_found(late_s, hz):
    found_s = look(late_s, hz=hz)
    assert late_s <= found_s <= late_s + 1.0 / hz + 0.05


@pytest.mark.parametrize("late_s", [7.0, np.inf])
def test_readings_that_show_nothing_of_a_move_are_refused(late_s):
    with pytest.raises(RobotFault, match="shows nothing of a move"):
        look(late_s)


def test_a_move_that_hardly_moves_the_flange_need_not_be_seen():
    assert look(np.inf, turn_rad=0.005, times=4) == LATEST_S


def test_a_beam_that_breaks_before_the_reflector_is_seen_to_leave_says_nothing_of_the_delay():
    assert look(3.0, broken_at_s=0.1, times=4) == LATEST_S


def test_a_beam_that_breaks_on_the_way_has_told_the_delay_before():
    assert look(0.2, broken_at_s=0.5) == pytest.approx(0.2, abs=0.05)


def test_a_gap_in_the_readings_says_nothing_of_the_delay_which_is_then_as_long_as_it_may_be():
    assert look(0.0, without=(-0.05, 1.0)) == LATEST_S


def test_readings_that_never_tell_how_late_they_are_are_refused():
    with pytest.raises(RobotFault, match="3 moves have not told how late"):
        look(0.0, without=(-0.05, 1.0), times=3)
