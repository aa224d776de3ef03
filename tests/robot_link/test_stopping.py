"""Bringing a robot to rest, by hand-made samples: what counts is what is seen, not what is answered."""

import time
from dataclasses import replace

import numpy as np
import pytest
from truepath.robot_link import RobotFault
from truepath.robot_link.state import RobotState, from_sample
from truepath.robot_link.stopping import STANDS_FOR_S, Rest, bring_to_rest

STILL = RobotState(
    time_s=0.0,
    arrived_s=0.0,
    q_rad=np.zeros(6),
    q_target_rad=np.zeros(6),
    speed_rad_s=np.zeros(6),
    temperatures_c=np.zeros(6),
    tcp_pose=np.zeros(6),
    robot_mode=7,
    safety="normal",
    program_running=False,
)
MOVING = replace(STILL, speed_rad_s=np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0]), program_running=True)


def samples(*states, every_s=0.02):
    return [replace(state, arrived_s=k * every_s) for k, state in enumerate(states)]


def stands_after(states):
    """At which sample the robot counts as standing; None if never."""
    rest = Rest()
    return next((k for k, state in enumerate(states) if rest.take(state)), None)


class Robot:
    """Stops by the ways in ``obeys``, and answers to all of them."""

    def __init__(self, *obeys):
        self.obeys, self.state, self.asked = obeys, MOVING, []

    def look(self):
        time.sleep(0.01)
        return replace(self.state, arrived_s=time.monotonic())

    def way(self, name, answer):
        def tell():
            self.asked.append(name)
            if name in self.obeys:
                self.state = STILL
            return answer

        return name, tell


def test_a_robot_stands_when_it_has_stood_for_a_while():
    assert stands_after(samples(*[STILL] * 30)) == round(STANDS_FOR_S / 0.02)


@pytest.mark.parametrize(
    "between",
    [
        MOVING,
        replace(STILL, program_running=True),
        replace(MOVING, program_running=False),
        replace(STILL, speed_rad_s=np.full(6, np.nan)),
        replace(STILL, q_rad=np.full(6, np.nan)),
    ],
    ids=["moves", "a program runs", "moves on without", "no speed", "no joints"],
)
def test_one_sample_of_low_speed_is_not_standing(between):
    assert stands_after(samples(*([STILL] * 10 + [between]) * 5)) is None


def test_joints_that_change_are_not_standing_whatever_speed_is_told():
    creeping = [replace(STILL, q_rad=np.full(6, 0.002 * k)) for k in range(60)]
    assert stands_after(samples(*creeping)) is None


def test_a_few_late_samples_are_not_standing():
    assert stands_after(samples(STILL, STILL, STILL, every_s=0.2)) is None


@pytest.mark.parametrize("runtime_state", [0, 1, 2, 3, 4, 5])
def test_a_program_that_is_paused_has_not_ended(runtime_state):
    """Numbers of the RTDE guide: stopping, stopped, playing, pausing, paused, resuming."""
    sample = {"time_s": 1, "arrived_s": 1, "q": [0] * 6, "q_target": [0] * 6, "speed": [0] * 6, "temperatures": [0] * 6}
    sample |= {"tcp_pose": [0] * 6, "robot_mode": 7, "safety_mode": 1, "safety_bits": 1, "speed_fraction": 1}
    sample |= {"payload_kg": None, "payload_cog_m": None, "runtime_state": runtime_state}
    assert from_sample(sample).program_running == (runtime_state >= 2)


def test_the_next_way_is_tried_when_a_robot_does_not_obey():
    robot = Robot("script")
    bring_to_rest(robot.look, [robot.way("dashboard", "Failed to execute: stop"), robot.way("script", "")], 5.0)
    assert robot.asked == ["dashboard", "script"]


def test_an_answer_of_success_is_no_success():
    robot = Robot()
    with pytest.raises(RobotFault, match=r"it still moves, and its program has not ended \(dashboard: Stopped"):
        bring_to_rest(robot.look, [robot.way("dashboard", "Stopped")], 0.1)


def test_a_robot_that_cannot_be_seen_is_not_said_to_stand():
    def look():
        raise RobotFault("no data")

    with pytest.raises(RobotFault, match="not known: no data"):
        bring_to_rest(look, [("dashboard", lambda: "Stopped")], 0.1)
