"""What the simulated tracker sees: the true reflector of a robot with hidden errors and causes, by Drake."""

import json

import numpy as np
import pytest
from drawn_robot import HOME
from truepath.virtual.controller.options import ControllerOptions
from truepath.virtual.controller.service import Service
from truepath.virtual.hidden_causes import draw_causes
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, truth_json
from truth_by_drake import reflector_poses

TRACKER = np.array([2.0, -1.0, 1.2])


def told_of(seed, *names):
    real = RealRobot("ur5", seed)
    return json.loads(truth_json(real, Campaign(), draw_causes(real, names)))


def eye_of(**options):
    service = Service(ControllerOptions(**{"seed": 5, "noise_mm": 0.0, **options}))
    service.machine.arm.place(np.array(HOME))
    return service.machine.arm, service.eye


def test_a_reading_is_the_true_place_of_the_reflector_after_moving_there():
    arm, eye = eye_of(hide=["backlash", "joint_compliance", "transmission_error"])
    arm.approach = -np.ones(6)  # as if every joint had come down
    truth = told_of(5, "backlash", "joint_compliance", "transmission_error")
    wanted = reflector_poses(truth, [HOME], [0.0], -np.ones((1, 6)))[0]
    assert np.allclose(eye.truth(), wanted, atol=1e-12)
    assert np.allclose(eye.look().p_ME, wanted[:3, 3], atol=1e-12)
    assert 1e-5 < np.abs(eye.true_joints() - HOME).max() < 1e-2


def test_readings_scatter_as_was_asked_for():
    _, eye = eye_of(noise_mm=0.05)
    readings = np.array([eye.look().p_ME for _ in range(400)])
    assert readings.std(axis=0) == pytest.approx(5e-5, rel=0.15)
    assert np.abs(readings.mean(axis=0) - eye.truth()[:3, 3]).max() < 1e-5


def test_what_slips_does_so_in_the_time_of_the_robot():
    _, eye = eye_of(hide=["frame_drift"])
    truth = told_of(5, "frame_drift")
    for time_s in (100.0, 2900.0):
        wanted = reflector_poses(truth, [HOME], [time_s], np.zeros((1, 6)))[0]
        assert np.allclose(eye.truth(time_s), wanted, atol=1e-9)


@pytest.mark.parametrize(("acceptance_deg", "visible"), [(180.0, True), (30.0, False)])
def test_a_tracker_that_stands_somewhere_measures_from_there_and_sees_what_faces_it(acceptance_deg, visible):
    _, eye = eye_of(tracker_at_m=TRACKER.tolist(), acceptance_deg=acceptance_deg)
    _, from_world = eye_of()
    sight = eye.look()
    assert np.allclose(sight.p_ME, from_world.look().p_ME - TRACKER, atol=1e-12)
    assert sight.visible is visible  # at home the reflector looks down


def test_a_reflector_that_looks_at_the_tracker_is_seen():
    below = np.array([0.55, 0.2, -1.0])
    _, eye = eye_of(tracker_at_m=below.tolist(), acceptance_deg=30.0)
    assert eye.look().visible
