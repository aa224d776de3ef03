"""Where base and probe were found is held against where they were stated, and a wrong statement is warned of.

The true places are Drake's: the virtual robot's own, moved by hand in the statement.
"""

from dataclasses import replace

import numpy as np
import pytest
from truepath import lie
from truepath.found_frames import found_frames
from truepath.learn import learn
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, measure


@pytest.fixture(scope="module")
def joints():
    return np.random.default_rng(3).uniform(-2.4, 2.4, (60, 6))


@pytest.fixture(scope="module")
def stated_as(joints):
    """Function: base and probe of virtual UR5 ``seed`` as found, their statement being off by these motions."""
    measured = {}

    def found(seed, base=None, probe=None, *, six_d=False, states=True):
        real = RealRobot("ur5", seed)
        if (seed, six_d) not in measured:
            measured[seed, six_d] = measure(real, joints, Campaign(orientation_noise_mrad=0.05 if six_d else None))
        data, robot = measured[seed, six_d], real.robot
        X_MB = robot.X_WB if base is None else robot.X_WB @ base
        X_FE = robot.X_FR if probe is None else robot.X_FR @ probe
        if states:
            data = replace(data, X_MB_nominal=X_MB, X_FE_nominal=X_FE)
        return found_frames(learn(robot, data).calibration)

    return found


def shift(*xyz_mm):
    return lie.make_pose(translation=1e-3 * np.array(xyz_mm))


def turn_mrad(angle):
    return lie.make_pose(lie.from_rotation_vector(np.array([0.0, 0.0, 1e-3 * angle])))


def test_where_they_were_found_does_not_depend_on_the_statement_and_how_far_it_is_off_does(stated_as):
    _, right = stated_as(7)
    _, wrong = stated_as(7, probe=shift(0, 0, 3.5))
    assert wrong.found_mm == pytest.approx(right.found_mm, abs=1e-6)
    assert wrong.off_mm == pytest.approx(np.linalg.norm(np.subtract(wrong.found_mm, wrong.stated_mm)), abs=1e-9)
    assert np.subtract(wrong.stated_mm, right.stated_mm) == pytest.approx([0, 0, 3.5], abs=1e-9)


def test_the_line_has_place_and_distance(stated_as):
    base, probe = stated_as(7)
    x, y, z = probe.found_mm
    assert probe.line.startswith(f"probe found at ({x:.2f}, {y:.2f}, {z:.2f}) mm on the flange, {probe.off_mm:.2f} mm ")
    assert f"{base.off_mm:.2f} mm and {base.off_mrad:.2f} mrad from where it was stated" in base.line
    assert "mrad" not in probe.line  # a reflector is a point


def test_a_probe_stated_a_few_millimetres_wrong_is_warned_of(stated_as):
    base, probe = stated_as(7, probe=shift(0, 0, 3.5))
    assert base.warning is None
    assert "--probe" in probe.warning
    assert f"{probe.off_mm:.1f} mm" in probe.warning
    assert "every target is moved" in probe.warning


@pytest.mark.parametrize("seed", [0, 4, 5, 7, 21])  # with 4 the axes alone put the probe 4 mm off: none is further off
def test_a_right_statement_is_not_suspected_however_crooked_the_robot_is(stated_as, seed):
    assert [frame.warning for frame in stated_as(seed)] == [None, None]


@pytest.mark.parametrize("motion", [shift(8, 0, 0), turn_mrad(8)], ids=["8 mm aside", "8 mrad about the vertical"])
def test_a_base_stated_wrong_is_warned_of(stated_as, motion):
    base, probe = stated_as(7, base=motion)
    assert "tracker" in base.warning
    assert probe.warning is None


def test_a_probe_with_an_orientation_may_be_turned_wrong(stated_as):
    _, right = stated_as(7, six_d=True)
    _, wrong = stated_as(7, probe=turn_mrad(20), six_d=True)
    assert right.warning is None
    assert f"{right.off_mrad:.2f} mrad" in right.line
    assert wrong.off_mrad == pytest.approx(20, abs=right.off_mrad)
    assert " mrad" in wrong.warning
    assert wrong.off_mm == pytest.approx(right.off_mm, abs=1e-6)


def test_where_nothing_was_stated_nothing_is_suspected(stated_as):
    for frame in stated_as(7, states=False):
        assert frame.off_mm is frame.off_mrad is frame.stated_mm is frame.warning is None
        assert frame.line.endswith("not stated")
