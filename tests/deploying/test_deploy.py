"""Deployment against the virtual controller, whose own record says whether the arm has moved, and where it stands."""

import json
import signal
import threading
import time

import numpy as np
import pytest
from command import is_refused
from controller_settings import setting
from truepath import plants
from truepath.controller import controller_of, vectors_from_poses
from truepath.deploying.deploy import DeployOptions, NotReady, prepare, run
from truepath.deploying.follow import send_and_follow
from truepath.deploying.passages import Passages
from truepath.deploying.rehearsal import rehearse
from truepath.deploying.run_file import RunFile
from truepath.deploying.stall import Stall
from truepath.errors import InputError

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
NEARER = np.radians(60)
WELD_STOPS = (0, 2, 3, 4)  # targets at which the program waits


def true_reflector(q_rad):
    """``(N, 3)`` where the reflector of the cell as drawn is, in its world, by Drake."""
    plant = plants.load_plant("ur5_cell")
    context = plant.CreateDefaultContext()
    reflector, arm = plant.GetFrameByName("reflector"), plant.GetModelInstanceByName("ur5")
    places = []
    for q in q_rad:
        plant.SetPositions(context, arm, q)
        places.append(reflector.CalcPoseInWorld(context).translation())
    return np.array(places)


class Onlooker:
    """Asks the controller where its robot truly is, while others drive it."""

    def __init__(self, controller):
        self.controller, self.seen, self.going = controller, [], True
        self.thread = threading.Thread(target=self.look)

    def look(self):
        while self.going:
            state = self.controller.command({"do": "state"})
            self.seen.append((state["commanded_q_rad"], np.array(state["X_ME"])[:3, 3]))
            time.sleep(0.01)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.going = False
        self.thread.join()

    def place_at(self, q_rad):
        """``(3,)`` true place of the reflector when these joints were commanded."""
        away = [np.abs(np.subtract(q, q_rad)).max() for q, _ in self.seen]
        assert min(away) < 1e-5, "the arm was never there"
        return self.seen[int(np.argmin(away))][1]


def refusal(controller, weld, calibration, link, **options):
    with pytest.raises(NotReady) as refused:
        prepare(weld, calibration, link, DeployOptions(**options))
    assert controller.moves() == 0
    return refused.value.reason


# What is refused, and nothing moves


def test_another_payload_on_the_controller_is_refused(controller, weld, calibration, link):
    setting(controller, link, payload_kg=3.0)
    assert "payload of 3.00 kg" in refusal(controller, weld, calibration, link)


def test_another_centre_of_gravity_is_refused(controller, weld, calibration, link):
    setting(controller, link, payload_cog_m=[0.03, 0.0, 0.2])
    assert "at (30, 0, 200) mm" in refusal(controller, weld, calibration, link)


def test_another_payload_in_the_program_is_refused(controller, corrected, calibration, link):
    text = "def heavy():\n  set_payload(4.5)\n  movej([0, -1.57, 1.57, -1.57, -1.57, 0])\nend\n"
    with pytest.raises(InputError, match=r"line 3 sets a payload of 4\.50 kg"):
        prepare(corrected(text, name="heavy.script"), calibration, link, DeployOptions())
    assert controller.moves() == 0


def test_another_tool_on_the_controller_is_refused(controller, weld, calibration, link):
    setting(controller, link, tcp_offset=[0.08, 0.0, 0.17, 0.0, 0.0, 0.0])
    reason = refusal(controller, weld, calibration, link)
    assert "(80.0, 0.0, 170.0) mm" in reason
    assert "10.0 mm" in reason


def test_local_control_is_refused(controller, weld, calibration, link):
    setting(controller, link, remote_control=False)
    assert "remote control" in refusal(controller, weld, calibration, link)


@pytest.mark.parametrize("stop", ["protective_stop", "emergency_stop"])
def test_a_safety_stop_is_refused(controller, weld, calibration, link, stop):
    controller.command({"do": "fault", "name": stop})
    time.sleep(0.2)
    assert stop.replace("_", " ") in refusal(controller, weld, calibration, link)


def test_a_robot_far_from_the_start_of_the_program_is_refused(controller, weld, calibration, link):
    setting(controller, link, q_rad=[1.0, -1.57, 1.57, -1.57, -1.57, 0.0])
    assert "joint 1 (shoulder_pan_joint) is 57 deg" in refusal(controller, weld, calibration, link)
    prepare(weld, calibration, link, DeployOptions(start_within_rad=NEARER))


def test_a_program_that_starts_with_a_pose_needs_its_start(controller, tmp_path, calibration, link):
    path = tmp_path / "pose.script"
    path.write_text("movej(p[-0.525, -0.15, 0.163, -2.22, -2.22, 0])\n")
    with pytest.raises(InputError, match="starts with a pose"):
        prepare(path, calibration, link, DeployOptions(uncorrected=True))


def test_a_robot_that_would_take_another_posture_is_refused(controller, tmp_path, calibration, link):
    """Joint 6 gets to -175 deg from 0 deg, but to 185 deg from 20 deg."""
    believed = controller_of(calibration.model.robot)
    X_CT = believed.tool_poses((HOME + np.radians([0, 0, 0, 0, 0, -175]))[None], np.eye(4))
    path = tmp_path / "turn.script"
    path.write_text(f"set_tcp(p[0,0,0,0,0,0])\nmovej(p{vectors_from_poses(X_CT)[0].tolist()})\n")
    setting(controller, link, q_rad=[*HOME[:5], np.radians(20)])
    options = {"uncorrected": True, "start_rad": tuple(HOME), "start_within_rad": np.pi}
    assert "other postures" in refusal(controller, path, calibration, link, **options)


def test_a_robot_that_nobody_answers_for_is_refused(truepath, weld, calibration_file):
    refused = truepath("deploy", weld, "--robot-host", "127.0.3.29", "-c", calibration_file, "--yes")
    assert refused.code == 1
    assert "refused" in refused.err


def test_nobody_to_ask_is_no_consent(truepath, weld, calibration_file, monkeypatch):
    monkeypatch.setattr("sys.stdin", open("/dev/null"))  # noqa: SIM115
    assert is_refused(truepath("deploy", weld, "--robot-host", "127.0.3.29", "-c", calibration_file), "--yes")


def test_an_uncorrected_program_is_refused(truepath, tmp_path, calibration_file):
    (tmp_path / "a.script").write_text("movej([0, -1.57, 1.57, -1.57, -1.57, 0])\n")
    arguments = (tmp_path / "a.script", "--robot-host", "127.0.3.29", "-c", calibration_file, "--yes")
    assert is_refused(truepath("deploy", *arguments), "not corrected")


def test_a_dry_run_moves_nothing(truepath, controller, weld, calibration_file):
    dry = truepath("deploy", weld, "--robot-host", controller.address, "-c", calibration_file, "--dry-run", "--json")
    assert dry.code == 0, dry.err
    assert dry.json()["ready"]
    assert controller.moves() == 0


# A run


def test_the_tool_goes_where_the_program_means_it_to_go(
    truepath, controller, weld, calibration, calibration_file, tmp_path
):
    """Where the program as written sends the robot as drawn, the true robot is, when it runs the corrected one."""
    record = tmp_path / "run.csv"
    arguments = (weld, "--robot-host", controller.address, "-c", calibration_file, "--yes", "-o", record, "--json")
    with Onlooker(controller) as onlooker:
        done = truepath("deploy", *arguments)
    assert done.code == 0, done.err
    summary = done.json()
    assert summary["completed"]
    assert summary["passed"] == summary["targets"] == 5
    assert summary["tool_off_mm"]["max"] < 0.02
    believed = controller_of(calibration.model.robot)
    programmed = rehearse((weld.parent / "weld.script").read_text(), believed, HOME, [0.0] * 6)
    commanded = np.array([each["commanded_rad"] for each in summary["per_target"]])
    wanted = true_reflector(programmed.q_rad)[list(WELD_STOPS)]
    true = np.array([onlooker.place_at(commanded[k]) for k in WELD_STOPS])
    assert 1e3 * np.linalg.norm(true - wanted, axis=1).max() < 0.1
    assert np.abs(np.degrees(commanded - programmed.q_rad)).max() > 0.02  # something was corrected
    rows = np.loadtxt(record, delimiter=",", skiprows=1)
    assert rows.shape[1] == 14
    assert len(rows) == summary["samples"]
    assert rows[-1, 1] >= 4
    assert (np.diff(rows[:, 0]) > 0).all()


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"name": "protective_stop"}, "protective stop"),
        ({"name": "connection_lost", "for_s": 1.0}, "the connection was lost"),
    ],
)
def test_what_stops_a_run_is_told_and_the_robot_stands(controller, slow, calibration, link, tmp_path, fault, words):
    prepared = prepare(slow, calibration, link, DeployOptions())
    fired = []

    def watched(passed, state):
        if passed and not fired:
            fired.append(controller.command({"do": "fault", **fault}))

    outcome = run(prepared, link, tmp_path / "run.csv", watched, print)
    assert not outcome.as_planned
    assert words in outcome.ended
    assert outcome.passed == 1
    assert "was told to stop" in outcome.ended
    state = controller.command({"do": "state"})
    assert state["program"] is None
    time.sleep(0.1)
    assert controller.command({"do": "state"})["commanded_q_rad"] == state["commanded_q_rad"]
    assert state["commanded_q_rad"][0] < 0.9
    assert len((tmp_path / "run.csv").read_text().splitlines()) == 1 + outcome.followed.samples


def test_ctrl_c_stops_the_robot(controller, slow, calibration, link):
    prepared, fired = prepare(slow, calibration, link, DeployOptions()), []

    def watched(passed, state):
        if passed and not fired:
            fired.append(True)
            signal.raise_signal(signal.SIGINT)

    outcome = run(prepared, link, None, watched, print)
    assert outcome.followed.interrupted
    assert "Ctrl-C" in outcome.ended
    assert controller.command({"do": "state"})["program"] is None


def test_a_robot_that_only_stands_is_stopped(controller, link, way_of):
    waits, passages = "def waits():\n  sleep(1000)\nend\n", Passages(np.zeros((0, 6)), np.zeros(0))
    with RunFile(None) as nothing:
        followed = send_and_follow(link, waits, passages, way_of(waits), nothing, Stall(0.4), lambda *_: None)
    assert "has stood" in followed.ended
    assert not followed.completed
    assert controller.command({"do": "state"})["program"] is None


def test_a_program_that_the_controller_does_not_run_to_its_end_is_told(controller, tmp_path, calibration, link):
    """The controller has no socket: its program ends there."""
    path = tmp_path / "asks.script"
    path.write_text("movej([0.05, -1.57, 1.57, -1.57, -1.57, 0])\nsocket_open(\"nowhere\", 1)\nmovej([0, -1, 1, -1, -1, 0])\n")  # fmt: skip # noqa: E501
    prepared = prepare(path, calibration, link, DeployOptions(uncorrected=True))
    assert any("socket_open" in remark for remark in prepared.remarks)
    assert any("not corrected" in remark for remark in prepared.remarks)
    outcome = run(prepared, link, None, lambda passed, state: None, print)
    assert outcome.passed == 1
    assert json.loads(json.dumps(outcome.summary()))["not_known"]
