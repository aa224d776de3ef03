"""What deploy must refuse although it is easily missed: each of these was once found ready, and moved."""

import os
from dataclasses import replace

import numpy as np
import pytest
from controller_settings import setting
from truepath import ur_models
from truepath.controller import controller_of, vectors_from_poses
from truepath.deploying.checks import another_robot_obstacles, moved_obstacles, robot_obstacles
from truepath.deploying.deploy import DeployOptions, NotReady, prepare, run
from truepath.errors import InputError
from truepath.robot_link import RobotLink
from truepath.virtual.controller.process import ControllerProcess

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
UNCORRECTED = {"uncorrected": True}
MOVE = "movej([0.05, -1.57, 1.57, -1.57, -1.57, 0])"
ASKS = "if get_standard_digital_in(0):\n  sync()\nend"


@pytest.fixture
def script(tmp_path):
    """Function: the file of an uncorrected program."""

    def script(*lines):
        path = tmp_path / "a.script"
        path.write_text("\n".join(["def a():", *lines, "end", ""]))
        return path

    return script


@pytest.mark.parametrize(
    ("before", "words"), [(ASKS, "get_standard_digital_in"), ("speedj([0.5, 0, 0, 0, 0, 0], 1.4, 2.0)", "by speed")]
)
def test_a_program_whose_first_target_nobody_knows_is_refused(controller, calibration, link, script, before, words):
    program = script(before, MOVE)
    with pytest.raises(InputError, match="where the program goes first") as refused:
        prepare(program, calibration, link, DeployOptions(**UNCORRECTED))
    assert words in refused.value.found
    assert "--unrehearsed" in refused.value.expected
    prepared = prepare(program, calibration, link, DeployOptions(**UNCORRECTED, unrehearsed=True))
    assert any("posture, joint limits" in remark for remark in prepared.remarks)


def test_somebody_who_says_so_may_run_it(truepath, controller, calibration_file, script):
    where = ("--robot-host", controller.address, "-c", calibration_file, "--uncorrected", "--dry-run", "--json")
    assert truepath("deploy", script(ASKS, MOVE), *where).code == 2
    allowed = truepath("deploy", script(ASKS, MOVE), *where, "--unrehearsed")
    assert allowed.code == 0
    assert allowed.json()["targets"] == 0


def test_a_payload_beyond_a_question_to_a_sensor_is_looked_at(controller, calibration, link, script):
    program = script(MOVE, ASKS, "set_target_payload(4.0, [0, 0, 0.2])", MOVE)
    with pytest.raises(InputError, match=r"line 6 .*payload of 4\.00 kg"):
        prepare(program, calibration, link, DeployOptions(**UNCORRECTED))


def test_a_payload_that_is_computed_there_is_told(controller, calibration, link, script):
    program = script(MOVE, ASKS, "m = 4", "set_payload(m)", MOVE)
    prepared = prepare(program, calibration, link, DeployOptions(**UNCORRECTED))
    assert any("cannot be looked at: line 7" in remark for remark in prepared.remarks)


def test_a_payload_that_differs_a_little_is_told(controller, weld, calibration, link):
    setting(controller, link, payload_kg=0.86, payload_cog_m=[0.05, 0.0, 0.037])
    prepared = prepare(weld, calibration, link, DeployOptions())
    assert any("controller is set to a payload of 0.86 kg" in remark for remark in prepared.remarks)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"tcp_offset": [0.08, 0.0, 0.26, 0.0, 0.0, 0.0]}, "100.0 mm"),
        ({"payload_kg": 4.0}, "4.00 kg"),
        ({"remote_control": False}, "local control"),
        ({"q_rad": [0.01, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0]}, "was moved"),
    ],
)
def test_what_changes_while_the_question_is_open_is_seen(controller, weld, calibration, link, tmp_path, changed, words):
    record = tmp_path / "run.csv"
    record.write_text("of an earlier run")
    prepared = prepare(weld, calibration, link, DeployOptions())
    setting(controller, link, **changed)
    before = controller.moves()
    with pytest.raises(NotReady, match=words):
        run(prepared, link, record, lambda passed, state: None, print)
    assert controller.moves() == before
    assert record.read_text() == "of an earlier run"


def test_another_type_of_robot_is_refused(calibration, weld, controller):
    state = controller.command({"do": "state"})
    load = {"payload_kg": 1.03, "payload_cog_m": [0.03003, 0.0, 0.03626], "tcp_offset": [0.08, 0, 0.16, 0, 0, 0]}
    start = state["commanded_q_rad"]
    with ControllerProcess(f"127.0.9.{50 + WORKER}", robot="ur10_cell", q_start_rad=start, **load) as other:
        is_told = pytest.raises(NotReady, match=r"this is not a ur5: .*It says that it is a UR10")
        with RobotLink(other.address, timeout_s=2.0) as link, is_told:
            prepare(weld, calibration, link, DeployOptions())
        assert other.command({"do": "state"})["moves"] == 0


@pytest.mark.parametrize(("model", "is_another"), [("UR5", False), ("UR5e", True), ("UR3", True)])
def test_an_arm_as_measured_in_the_factory_is_the_same_and_another_type_is_not(link, calibration, model, is_another):
    """Published lengths, and angles and lengths as a factory calibration changes them."""
    deviation = np.random.default_rng(0).normal(0, [[3e-3], [1e-3], [1e-3], [1e-3]], (4, 6))
    deviation[2, 1:3] = 0  # along parallel axes
    q = np.array([0.3, -1.2, 1.4, -1.5, -1.5, 0.4])
    arm = ur_models.chain(ur_models.published(model) + deviation)
    turned = np.eye(4)
    for k, angle in enumerate(q):
        X_CA = arm.X_CA[k]
        turned = turned @ X_CA @ _turn(angle) @ np.linalg.inv(X_CA)
    told = vectors_from_poses((turned @ arm.X_C0)[None])[0]
    state = replace(link.state(), q_rad=q, tcp_pose=told)
    controller = controller_of(calibration.model.robot)
    assert bool(another_robot_obstacles(controller, "ur5", state, np.zeros(6), "")) is is_another


def test_joints_that_are_no_numbers_are_not_where_they_were(link):
    state, nothing = link.state(), np.full(6, np.nan)
    assert moved_obstacles(replace(state, q_rad=nothing), state.q_rad)


@pytest.mark.parametrize("name", ["q_rad", "speed_rad_s", "tcp_pose"])
def test_a_robot_that_tells_no_numbers_is_not_ready(link, name):
    class Link:
        def state(self):
            return replace(link.state(), **{name: np.full(6, np.nan)})

        def dashboard(self, question):
            return link.dashboard(question)

    assert not robot_obstacles(link)[1]
    assert robot_obstacles(Link())[1]


def _turn(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
