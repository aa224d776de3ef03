"""When a robot stands still: samples made by hand, one every 8 ms."""

import time
from dataclasses import replace

import numpy as np
import pytest
from truepath.robot_link import RobotFault, RobotState
from truepath.robot_link.standstill import wait_until_still

Q = np.array([0.1, -1.0, 1.2, -0.4, 0.3, 0.0])
STILL = RobotState(0.0, 0.0, Q, Q, np.zeros(6), np.full(6, 30.0), np.zeros(6), 7, "normal", True)


class Robot:
    """Gives the samples that have come about since it was made; ``at(seconds)`` is its state."""

    def __init__(self, at):
        self._at, self._begin, self._told = at, time.monotonic(), 0

    def state(self):
        return self._at(time.monotonic() - self._begin)

    def samples(self):
        due = int((time.monotonic() - self._begin) / 0.008)
        found = [replace(self._at(k * 0.008), arrived_s=self._begin + k * 0.008) for k in range(self._told, due)]
        self._told = due
        return found


def moved(angle_rad=0.0, speed=0.0, off_target_rad=0.0):
    return replace(
        STILL, q_rad=Q + angle_rad, q_target_rad=Q + angle_rad - off_target_rad, speed_rad_s=np.full(6, speed)
    )


def test_a_robot_that_stands_is_read_for_the_time_asked():
    window = wait_until_still(Robot(lambda t: STILL), 0.1, 1.0)
    assert 12 <= len(window) <= 20
    assert window[-1].arrived_s - window[0].arrived_s >= 0.1


@pytest.mark.parametrize(
    "way_there",
    [
        lambda t: moved(speed=0.02),
        lambda t: moved(off_target_rad=0.01),
        lambda t: moved(angle_rad=2e-3 * np.sin(80.0 * t)),  # swings on, though its speed is not told
        lambda t: moved(angle_rad=0.01 * t),
    ],
    ids=["moving", "not there yet", "swinging", "creeping"],
)
def test_only_samples_after_coming_to_rest_count(way_there):
    window = wait_until_still(Robot(lambda t: way_there(t) if t < 0.2 else STILL), 0.1, 1.0)
    assert all(np.abs(state.q_rad - Q).max() < 1e-4 for state in window)


def test_a_robot_that_never_rests_is_told():
    with pytest.raises(RobotFault, match="does not come to rest"):
        wait_until_still(Robot(lambda t: moved(angle_rad=0.01 * np.sin(20 * t))), 0.1, 0.2)


def test_a_robot_that_stops_is_not_still_but_stopped():
    with pytest.raises(RobotFault, match="protective stop"):
        wait_until_still(Robot(lambda t: replace(STILL, safety="protective_stop")), 0.1, 0.2)
