"""The rehearsal: where a program goes, without a robot. Drake says where the tool is at the joints."""

import numpy as np
import pytest
from drake_arm import DrakeArm
from truepath import plants
from truepath.controller import controller_of
from truepath.deploying.rehearsal import rehearse
from truepath.programs.motions import Kind
from truepath.virtual.controller.kinematics import pose_matrix

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
TORCH = [0.08, 0, 0.16, 0, 0, 0]
NO_TOOL = [0.0] * 6


@pytest.fixture(scope="module")
def controller(ur5):
    return controller_of(ur5)


def test_targets_of_the_weld_program_have_joints_that_lead_there(controller):
    text = (plants.models_dir() / "ur5" / "weld.script").read_text()
    rehearsal = rehearse(text, controller, HOME, NO_TOOL)
    assert rehearsal.open_end is None
    assert len(rehearsal) == 14
    assert rehearsal.line[:3].tolist() == [20, 21, 22]
    assert [Kind(k) for k in rehearsal.kind[-4:]] == [Kind.ARC, Kind.ARC, Kind.LINEAR, Kind.JOINT]
    assert rehearsal.depends_on_tool
    assert [each.mass_kg for each in rehearsal.payloads] == [0.86]
    assert rehearsal.longest_wait_s == 0.2
    seam = pose_matrix([-0.525, -0.15, 0.113, -2.221441469, -2.221441469, 0])
    X_BF = DrakeArm("ur5").flange_poses(rehearsal.q_rad[2:3])[0]
    reached = controller.X_BC.T @ X_BF @ controller.X_F0 @ pose_matrix(TORCH)
    assert np.abs(reached - seam).max() < 1e-8


def test_a_program_of_joints_needs_no_tool(controller):
    assert not rehearse("movej([0,-1,1,-1,-1,0])", controller, HOME, NO_TOOL).depends_on_tool
    assert rehearse("movel([0,-1,1,-1,-1,0])", controller, HOME, NO_TOOL).depends_on_tool


def test_what_a_sensor_decides_stays_open(controller):
    text = "movej([0,-1,1,-1,-1,0])\nif get_standard_digital_in(0):\nmovej([1,-1,1,-1,-1,0])\nend\n"
    rehearsal = rehearse(text, controller, HOME, NO_TOOL)
    assert len(rehearsal) == 1
    assert "get_standard_digital_in" in rehearsal.open_end


def test_where_joints_go_by_speed_nobody_knows_and_a_stop_is_no_speed(controller):
    home, away = "movej([0,-1,1,-1,-1,0])", "movej([1,-1,1,-1,-1,0])"
    rehearsal = rehearse(f"{home}\nspeedj([0.5,0,0,0,0,0], 1.4, 2.0)\n{away}\n", controller, HOME, NO_TOOL)
    assert len(rehearsal) == 1
    assert "line 2 moves the joints by speed" in rehearsal.open_end
    assert len(rehearse(f"{home}\nstopj(2.0)\n{away}\n", controller, HOME, NO_TOOL)) == 2


def test_a_program_that_never_ends_is_followed_for_a_while(controller):
    rehearsal = rehearse("while True:\nmovej([0,-1,1,-1,-1,0])\nsync()\nend\n", controller, HOME, NO_TOOL)
    assert rehearsal.open_end == "it goes on and on"
    assert len(rehearsal) < 1000
