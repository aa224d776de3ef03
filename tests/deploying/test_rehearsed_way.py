"""The rehearsed way: where the joints may be. Drake says where the tool is there."""

import numpy as np
import pytest
from drake_arm import DrakeArm
from truepath.controller import controller_of
from truepath.deploying.rehearsal import rehearse
from truepath.deploying.rehearsed_way import MARGIN_RAD, rehearsed_way
from truepath.virtual.controller.kinematics import pose_matrix

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
DOWN = "-2.221441469, -2.221441469, 0"
TORCH = "set_tcp(p[0.08, 0, 0.16, 0, 0, 0])\n"
TO_A = f"movej(get_inverse_kin(p[-0.525, -0.15, 0.113, {DOWN}]))\n"
LINE = TORCH + TO_A + f"movel(p[-0.675, -0.15, 0.213, {DOWN}])\n"
ARC = TORCH + TO_A + f"movec(p[-0.6, -0.075, 0.113, {DOWN}], p[-0.675, -0.15, 0.113, {DOWN}])\n"


@pytest.fixture(scope="module")
def believed(ur5):
    return controller_of(ur5)


@pytest.fixture(scope="module")
def way_from_a(believed):
    """Function: the way of the last move of a program from where the one before ends."""

    def way_from_a(text):
        at_a = rehearse(text, believed, HOME, [0.0] * 6).q_rad[0]
        last = TORCH + text.splitlines()[-1] + "\n"
        return rehearsed_way(rehearse(last, believed, at_a, [0.0] * 6), believed, at_a)

    return way_from_a


@pytest.fixture(scope="module")
def torch_tips(believed):
    """Function: the tip of the torch in C at joints, by Drake."""
    arm = DrakeArm("ur5")

    def torch_tips(q):
        X_C0 = believed.X_BC.T @ arm.flange_poses(q) @ believed.X_F0
        return (X_C0 @ pose_matrix([0.08, 0, 0.16, 0, 0, 0]))[:, :3, 3]

    return torch_tips


def test_on_a_line_the_tool_is_on_the_line(way_from_a, torch_tips):
    tips = torch_tips(np.array(way_from_a(LINE).tree.data))
    a, b = np.array([-0.525, -0.15, 0.113]), np.array([-0.675, -0.15, 0.213])
    along = (tips - a) @ (b - a) / ((b - a) @ (b - a))
    assert np.linalg.norm(tips - a - along[:, None] * (b - a), axis=1).max() < 1e-3
    assert along[0] == pytest.approx(0.0, abs=1e-6)
    assert along[-1] == pytest.approx(1.0, abs=1e-6)
    assert np.diff(along).max() < 0.2


def test_on_an_arc_it_is_on_the_circle(way_from_a, torch_tips):
    tips = torch_tips(np.array(way_from_a(ARC).tree.data))
    radius = np.linalg.norm(tips - [-0.6, -0.15, 0.113], axis=1)
    assert np.abs(radius - 0.075).max() < 1e-3
    assert tips[:, 1].max() == pytest.approx(-0.075, abs=1e-3)


def test_joints_that_are_as_far_away_as_is_allowed_have_not_strayed_and_farther_ones_have(way_of):
    way = way_of("movej([1, -1.57, 1.57, -1.57, -1.57, 0])\n")
    halfway = HOME + np.array([0.5, 0, 0, 0, 0, 0])
    for joint in range(1, 6):
        aside = np.eye(6)[joint]
        assert way.strayed((halfway + (MARGIN_RAD - 0.01) * aside)[None]) is None
        found = way.strayed(np.array([halfway, halfway - (MARGIN_RAD + 0.02) * aside]))
        assert f"joint {joint + 1} is 6." in found
    assert way.strayed((HOME - [0.2, 0, 0, 0, 0, 0])[None]) is not None


def test_where_corners_are_rounded_more_is_allowed(way_of):
    corner = "movej([0.5, -1.57, 1.57, -1.57, -1.57, 0], r={})\nmovej([0.5, -1, 1.57, -1.57, -1.57, 0])\n"
    off_the_corner = HOME + np.array([0.35, 0.15, 0, 0, 0, 0])
    assert way_of(corner.format(0)).strayed(off_the_corner[None]) is not None
    assert way_of(corner.format(0.05)).strayed(off_the_corner[None]) is None


def test_a_way_that_a_sensor_decides_holds_as_far_as_it_is_known(way_of):
    text = "movej([0.1, -1.57, 1.57, -1.57, -1.57, 0])\n"
    asks = text + "if get_standard_digital_in(0):\n movej([1, -1, 1, -1, -1, 0])\nend\n"
    assert way_of(text).holds(1)
    assert way_of(asks).holds(0)
    assert not way_of(asks).holds(1)


def test_who_waits_only_may_not_move(way_of):
    way = way_of("sleep(1)\n")
    assert way.strayed(HOME[None]) is None
    assert way.strayed(HOME[None] + 0.2) is not None
