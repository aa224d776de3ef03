"""Profiles, paths and arcs of the virtual controller, against hand calculation and Drake."""

import numpy as np
import pytest
from drawn_robot import HOME, TOOL, transform
from pydrake.math import RollPitchYaw
from truepath.errors import InputError
from truepath.virtual.controller.cartesian import Arc, Line, ToolPath, UnreachableError
from truepath.virtual.controller.kinematics import NominalKinematics, pose_matrix, pose_vector
from truepath.virtual.controller.motions import AtSpeed, JointPath, Pursuit, Schedule, SlowingDown
from truepath.virtual.controller.planning import Leg, path
from truepath.virtual.controller.profiles import Trapezoid

QUARTER = np.array([0.6, -1.1, 1.0, -1.3, -1.2, 0.4])


@pytest.fixture(scope="module")
def kinematics():
    return NominalKinematics("ur5_cell")


def sampled(motion, count=400):
    times = np.linspace(0, motion.duration_s, count)
    q, qd = zip(*(motion.at(t) for t in times), strict=True)
    return times, np.array(q), np.array(qd)


def test_a_profile_takes_the_time_of_a_trapezoid_and_reaches_its_speed():
    # 2 rad at 1 rad/s and 2 rad/s^2: half a second and a quarter of a radian for each ramp, 1.5 s between them.
    profile = Trapezoid.of(2.0, 1.0, 2.0)
    assert profile.duration_s == pytest.approx(2.5)
    assert profile.at(0.25) == pytest.approx((0.0625 / 2, 0.25))
    assert profile.at(1.25) == pytest.approx((0.5, 0.5))
    assert profile.at(2.5) == (1.0, 0.0)
    # Too short a way for the full speed: up and down in sqrt(length / acceleration) each.
    assert Trapezoid.of(0.5, 10.0, 2.0).duration_s == pytest.approx(1.0)
    assert Trapezoid.of(0.5, 10.0, 2.0, time_s=4.0).duration_s == 4.0


@pytest.mark.parametrize("numbers", [(1.0, 0.0, 1.0), (1.0, 1.0, 0.0), (1.0, -1.0, 1.0), (1.0, float("nan"), 1.0)])
def test_a_motion_that_would_never_arrive_is_refused(numbers):
    with pytest.raises(InputError):
        Trapezoid.of(*numbers)


@pytest.mark.parametrize("legs", [1, 4])
def test_speeds_are_the_slopes_of_positions_and_nothing_jumps(kinematics, legs):
    waypoints = np.array(HOME) + np.cumsum(np.full((legs, 6), 0.2) * np.arange(1, legs + 1)[:, None] ** 0, axis=0)
    motion = path(kinematics, np.array(HOME), np.eye(4), [Leg(q, 1.0, 1.4, blend_m=0.03) for q in waypoints])
    times, q, qd = sampled(motion, 4000)
    assert np.abs(np.diff(q, axis=0) - 0.5 * (qd[1:] + qd[:-1]) * np.diff(times)[:, None]).max() < 1e-6
    assert np.abs(np.diff(qd, axis=0)).max() < 0.02


def test_a_stop_goes_on_along_the_way_of_the_motion():
    motion = JointPath.to(np.zeros(6), np.arange(6.0), 1.0, 2.0)
    stop = SlowingDown(motion, 1.0, 0.4)
    _, q, qd = sampled(stop)
    assert np.allclose(q[0], motion.at(1.0)[0])
    assert np.allclose(qd[0], motion.at(1.0)[1])
    assert np.allclose(qd[-1], 0)
    assert np.allclose(q * 5 / np.maximum(q[:, 5:], 1e-9), np.arange(6.0), atol=1e-6)
    assert q[-1, 5] - q[0, 5] == pytest.approx(0.5 * 0.4 * qd[0, 5])


def test_a_held_speed_is_reached_at_its_acceleration():
    motion = AtSpeed(np.zeros(6), np.zeros(6), np.full(6, 0.5), 1.0)
    assert np.allclose(motion.at(0.25)[1], 0.25)
    q, qd = motion.at(2.0)
    assert np.allclose(qd, 0.5)
    assert np.allclose(q, 0.5 * 0.5 * 0.5 + 0.5 * 1.5)


def test_a_pursuit_of_a_steady_target_lags_by_what_it_says():
    lag, speed, step = 0.1, 0.4, 0.002
    q, qd = np.zeros(6), np.zeros(6)
    for k in range(1000):
        q, qd = Pursuit(q, qd, np.full(6, speed * step * k), lag).at(step)
    assert np.allclose(speed * step * 999 - q, speed * lag, rtol=0.03)
    assert np.allclose(qd, speed, rtol=1e-3)


def test_three_legs_never_overlap():
    profiles = [Trapezoid(1.0, 0.5), Trapezoid(0.2, 0.1), Trapezoid(1.0, 0.5)]
    schedule = Schedule(profiles, [0.5, 0.5])
    assert schedule.starts_s == pytest.approx([0.0, 0.9, 1.0])
    assert schedule.duration_s == pytest.approx(2.0)


def test_poses_and_tool_speeds_are_drakes(kinematics, drawn):
    assert np.allclose(kinematics.forward(QUARTER), drawn.flange(QUARTER).GetAsMatrix4(), atol=1e-14)
    rates, h = np.array([0.1, -0.2, 0.3, 0.2, -0.1, 0.4]), 1e-6
    X_0T = transform(TOOL).GetAsMatrix4()
    V = kinematics.jacobian(QUARTER, X_0T) @ rates
    ahead, behind = (drawn.tool(QUARTER + s * h * rates, TOOL) for s in (1, -1))
    assert np.allclose(V[3:], (ahead.translation() - behind.translation()) / (2 * h), atol=1e-8)
    turned = (ahead.rotation() @ behind.rotation().inverse()).ToAngleAxis()
    assert np.allclose(V[:3], turned.angle() * turned.axis() / (2 * h), atol=1e-6)
    assert np.allclose(kinematics.joint_speeds(QUARTER, X_0T, V), rates, atol=1e-6)


def test_the_inverse_leads_back_to_the_posture_it_is_near_to(kinematics):
    dice = np.random.default_rng(0)
    for _ in range(40):
        q = dice.uniform(-2.5, 2.5, 6)
        found = kinematics.inverse(kinematics.forward(q), q + dice.uniform(-0.05, 0.05, 6))
        assert found is not None
        assert np.allclose(kinematics.forward(found), kinematics.forward(q), atol=1e-7)
    far = np.eye(4)
    far[0, 3] = 2.0
    assert kinematics.inverse(far, np.array(HOME)) is None


def test_a_pose_survives_its_six_numbers():
    for pose in ([0.1, 0.2, 0.3, 0, 0, 0], [0, 0, 0, np.pi, 0, 0], [1, 2, 3, 1.2, -1.4, 0.3]):
        X = pose_matrix(pose)
        assert np.allclose(X, transform(pose).GetAsMatrix4(), atol=1e-15)
        assert np.allclose(pose_matrix(pose_vector(X)), X, atol=1e-12)


def test_an_arc_passes_its_three_points_on_one_circle():
    X, goal = np.eye(4), np.eye(4)
    X[:3, 3], via, goal[:3, 3] = [1, 0, 0], np.array([0, 1, 0]), [0, -1, 0]
    goal[:3, :3] = RollPitchYaw(0, 0, 0.5).ToRotationMatrix().matrix()
    arc = Arc.through(X, via, goal, follow=False)
    assert arc.angle_rad == pytest.approx(1.5 * np.pi)
    points = np.array([X[:3, 3] + arc.offset(share) for share in np.linspace(0, 1, 7)])
    assert np.allclose(np.linalg.norm(points, axis=1), 1.0)
    assert np.allclose(points[2], via)
    assert np.allclose(points[-1], goal[:3, 3])
    assert np.allclose(arc.turn(1.0), goal[:3, :3])
    along = Arc.through(X, via, goal, follow=True)
    assert np.allclose(along.turn(1.0), RollPitchYaw(0, 0, 1.5 * np.pi).ToRotationMatrix().matrix())


def test_three_points_on_a_line_are_a_line():
    X, goal = np.eye(4), np.eye(4)
    goal[:3, 3] = [2, 0, 0]
    assert isinstance(Arc.through(X, np.array([1.0, 0, 0]), goal, follow=False), Line)


def test_the_tool_on_an_arc_stays_on_it_and_its_speed_is_the_slope(kinematics, drawn):
    X = kinematics.forward(np.array(HOME))
    via, goal = X[:3, 3] + [0.05, 0.05, 0], X.copy()
    goal[:3, 3] = X[:3, 3] + [0.1, 0, 0]
    motion = path(kinematics, np.array(HOME), np.eye(4), [Leg(goal, 0.25, 1.2, via=via)])
    times, q, qd = sampled(motion)
    points = np.array([drawn.flange(each).translation() for each in q])
    assert np.allclose(np.linalg.norm(points - X[:3, 3] - [0.05, 0, 0], axis=1), 0.05, atol=1e-8)
    assert np.abs(np.gradient(q, times, axis=0) - qd)[5:-5].max() < 0.01


def test_a_line_that_leaves_the_reach_of_the_arm_cannot_be_followed(kinematics):
    X = kinematics.forward(np.array(HOME))
    goal = X.copy()
    goal[0, 3] -= 1.0
    motion = path(kinematics, np.array(HOME), np.eye(4), [Leg(goal, 0.25, 1.2)])
    assert isinstance(motion, ToolPath)
    assert np.isfinite(motion.at(0.3 * motion.duration_s)[0]).all()
    with pytest.raises(UnreachableError):
        motion.at(motion.duration_s)
