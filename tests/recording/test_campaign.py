"""Campaigns with a tracker that loses the reflector at moments chosen by the test; robot and moves are real enough."""

import time

import numpy as np
import pytest
from truepath.model import nominal_model
from truepath.plants import load_robot
from truepath.recording.campaign import Campaign
from truepath.recording.manner import Manner
from truepath.recording.readings import BeamBroken, Reading
from truepath.recording.row_file import RowFile
from truepath.recording.trackers import open_tracker
from truepath.recording.visit import columns
from truepath.robot_link import ControlLost, RobotFault, RobotLink
from truepath.robot_link.text_ports import ask_dashboard, send_program

BRISK = Manner(60.0, 200.0, settle_s=0.05, measure_s=0.05, tries=2, between_tries_s=0.05)
ROBOT = load_robot("ur5_cell")
FLANGE = nominal_model(ROBOT)


class Spy:
    """A tracker that sees what it is told to at a pose, and the moves as they are; remembers where it was asked."""

    gives_orientation = False

    def __init__(self, link, stream, sees):
        self._link, self._stream, self._sees, self.asked_at = link, stream, sees, []

    def reading(self, duration_s):
        self.asked_at.append(self._link.state().q_rad)
        spread_mm = self._sees(len(self.asked_at) - 1)
        if spread_mm is None:
            raise BeamBroken("something stands in the way")
        # Seen from the base, at the flange, with the noise without which a reading is a copy.
        p_BF = FLANGE.predict(self.asked_at[-1][None])[0, :3, 3]
        return Reading(p_BF + 1e-5 * np.sin(len(self.asked_at)), None, spread_mm, 10, 0.0)

    def seen_since(self, start_s):
        return self._stream.seen_since(start_s)

    def close(self):
        pass


@pytest.fixture(scope="module")
def stream(controller):
    with open_tracker("simulated", controller.address) as stream:
        yield stream


@pytest.fixture
def run(stream, at_home, poses, tmp_path):
    """Function: a campaign with a tracker that sees so; the outcome, the rows on the disk, the joints asked at."""

    def run(sees):
        data = tmp_path / "data.csv"
        with (
            RobotLink(at_home.address, timeout_s=3.0) as link,
            RowFile(data, poses[0], "00", columns(6, False), resume=True) as rows,
        ):
            spy = Spy(link, stream, sees)
            campaign = Campaign(link, spy, poses[0], rows, ROBOT, 0.0, BRISK)
            try:
                outcome = campaign.run()
            except RobotFault as fault:
                outcome = fault
        lines = data.read_text().splitlines()[1:]
        at = columns(6, False).index("visit")
        return outcome, [int(line.split(",")[at]) for line in lines], spy.asked_at

    return run


def test_a_short_break_is_waited_for(run):
    outcome, visits, _ = run(lambda k: None if k == 1 else 0.03)
    assert (outcome.measured, outcome.skipped, visits) == (4, {}, [1, 3, 4, 5])


def test_a_reflector_that_swings_is_waited_for(run):
    _outcome, visits, asked_at = run(lambda k: 0.5 if k == 0 else 0.03)
    assert visits == [1, 3, 4, 5]
    assert len(asked_at) == 5


def test_a_pose_out_of_sight_is_left_and_tried_again_at_the_end_from_its_own_side(run, poses):
    outcome, visits, asked_at = run(lambda k: None if k in (1, 2) else 0.03)
    assert (outcome.measured, outcome.skipped, visits) == (4, {}, [1, 4, 5, 3])
    assert np.allclose(asked_at[-1], poses[0].q_rad[2], atol=1e-4)


def test_a_pose_that_is_never_seen_is_told_and_the_others_stay(run):
    outcome, visits, _ = run(lambda k: None if k in (1, 2, 5, 6) else 0.03)
    assert visits == [1, 4, 5]
    assert outcome.skipped == {2: "something stands in the way"}


def test_a_tracker_that_has_lost_the_reflector_does_not_send_the_robot_round_for_nothing(run):
    outcome, visits, _asked_at = run(lambda k: 0.03 if k == 0 else None)
    assert isinstance(outcome, RobotFault)
    assert "3 poses in a row" in outcome.reason
    assert visits == [1]
    resumed, visits, _ = run(lambda k: 0.03)
    assert (resumed.measured, sorted(visits)) == (3, [1, 3, 4, 5])


def test_a_robot_that_somebody_else_has_moved_is_not_driven_on_from_there(run, at_home, poses):
    def moved_meanwhile(k):
        if k == 1:
            at_home.command({"do": "set", "q_rad": (poses[0].q_rad[2] + 0.2).tolist()})
        return 0.03

    outcome, visits, _ = run(moved_meanwhile)
    assert isinstance(outcome, RobotFault)
    assert "somebody else has moved the robot" in outcome.reason
    assert visits == [1]


FOREIGN = "def other():\n  sleep(400)\nend\n"


@pytest.mark.parametrize("what", ["stop", "pause", "another program"])
def test_after_a_hand_on_the_robot_while_it_stands_it_is_not_driven_on(run, at_home, what):
    """The robot would start to move beside the person who has just stopped it."""
    seen = {}

    def interfered(k):
        if k == 1:
            seen["moves"] = at_home.command({"do": "state"})["moves"]
            if what == "another program":
                send_program(at_home.address, FOREIGN, 2.0)
            else:
                ask_dashboard(at_home.address, what, 2.0)
            time.sleep(0.2)
        return 0.03

    outcome, visits, _ = run(interfered)
    assert isinstance(outcome, ControlLost)
    assert visits == [1] or (what == "another program" and visits == [1, 3])  # that one also leaves the robot at rest
    after = at_home.command({"do": "state"})
    assert after["moves"] == seen["moves"]
    if what == "another program":  # is not ours to end
        assert after["program"] == "other"
        at_home.command({"do": "stop"})


def test_a_robot_that_is_switched_to_local_control_is_not_moved_any_more(run, at_home):
    seen = {}

    def switched(k):
        if k == 1:
            seen["moves"] = at_home.command({"do": "state"})["moves"]
            at_home.command({"do": "set", "remote_control": False})
        return 0.03

    outcome, visits, _ = run(switched)
    assert "local control" in outcome.reason
    assert visits == [1, 3]
    assert at_home.command({"do": "state"})["moves"] == seen["moves"]


def test_a_payload_that_is_changed_meanwhile_ends_the_campaign(run, at_home):
    def changed(k):
        if k == 1:
            at_home.command({"do": "set", "payload_kg": 4.0})
            time.sleep(0.1)
        return 0.03

    outcome, visits, _ = run(changed)
    assert "payload on the controller was changed from 1.03 to 4.00 kg" in outcome.reason
    assert visits == [1]
