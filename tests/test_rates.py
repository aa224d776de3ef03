"""Joint speeds along motions: by hand, by a motion played in small steps of time, and by Drake's Jacobian."""

from dataclasses import replace

import numpy as np
import pytest
from drake_arm import DrakeArm
from truepath.inverse import solve
from truepath.model import nominal_flange_poses, nominal_model
from truepath.rates import Rates, joint_motions, rate_findings, servo_motions, tool_motions

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
NAN = np.nan


def per_motion(*values):
    return np.array(values, float)


def ends(*steps):
    """``(S, 2, n)`` motions, one after the other, from zero."""
    at = np.concatenate([np.zeros((1, len(steps[0]))), np.cumsum(steps, axis=0)])
    return np.stack([at[:-1], at[1:]], axis=1)


# Joints in step


def test_the_leading_joint_takes_the_stated_speed_and_the_others_their_share():
    q = ends([1.0, -0.5, 0.0], [0.25, 0.0, -0.25], [0.5, 1.0, 0.0])
    rates = joint_motions(q, per_motion(1.5, 1.5, 3.0), per_motion(4.0, 4.0, 4.0), per_motion(NAN, NAN, NAN))
    # The second way is so short that the joints brake from sqrt(4 * 0.25) = 1 rad/s, the third from 2 rad/s.
    assert rates.speed == pytest.approx(np.array([[1.5, 0.75, 0.0], [1.0, 0.0, 1.0], [1.0, 2.0, 0.0]]))
    assert rates.acceleration == pytest.approx(np.array([[4.0, 2.0, 0.0], [4.0, 0.0, 4.0], [2.0, 4.0, 0.0]]))


def test_a_stated_time_counts_instead_of_the_speed():
    rates = joint_motions(ends([1.0, -0.5]), per_motion(9.0), per_motion(9.0), per_motion(2.0))
    assert rates.speed == pytest.approx(np.array([[0.5, 0.25]]))
    assert np.isnan(rates.acceleration).all()


def test_what_is_not_stated_is_not_known():
    q = ends([1.0, 0.5], [1.0, 0.5])
    rates = joint_motions(q, per_motion(NAN, 1.0), per_motion(2.0, NAN), per_motion(NAN, NAN))
    assert np.isnan(rates.speed[0]).all()
    assert rates.acceleration[0] == pytest.approx([2.0, 1.0])
    assert rates.speed[1] == pytest.approx([1.0, 0.5])
    assert np.isnan(rates.acceleration[1]).all()


def test_a_motion_to_where_the_robot_is_takes_no_speed():
    rates = joint_motions(ends([0.0, 0.0]), per_motion(1.0), per_motion(1.0), per_motion(NAN))
    assert (rates.speed == 0).all()
    assert (rates.acceleration == 0).all()


# The tool along a way


def wave(s):
    """Joints ``(..., 2)`` at a way s of 0 to 0.4 m; the first turns faster and faster."""
    return np.stack([5.0 * s**2, 0.3 * np.sin(12.0 * s)], axis=-1)


def played(length, speed, acceleration):
    """Highest joint speeds and accelerations of ``wave``, driven from rest to rest in steps of time."""
    ramp = min(speed / acceleration, np.sqrt(length / acceleration))
    top = acceleration * ramp
    total = 2 * ramp + (length - top * ramp) / top
    t = np.linspace(0.0, total, 200_001)
    s = np.where(
        t < ramp,
        0.5 * acceleration * t**2,
        np.where(t > total - ramp, length - 0.5 * acceleration * (total - t) ** 2, 0.5 * top * ramp + top * (t - ramp)),
    )
    dt = t[1]
    velocity = np.diff(wave(s), axis=0) / dt
    # The joints jump in acceleration where the tool does: differences across these moments are no accelerations.
    middle = t[1:-1]
    smooth = (np.abs(middle - ramp) > 2 * dt) & (np.abs(middle - (total - ramp)) > 2 * dt)
    return np.abs(velocity).max(axis=0), np.abs(np.diff(velocity, axis=0) / dt)[smooth].max(axis=0)


def along(length, samples):
    return wave(np.linspace(0, length, samples))[None]


@pytest.mark.parametrize(
    ("speed", "acceleration"), [(0.25, 1.2), (0.25, 0.3), (5.0, 1.2)], ids=["cruise", "slow start", "never cruises"]
)
def test_a_trapezoid_from_rest_to_rest(speed, acceleration):
    no_time, no_turn = per_motion(NAN), per_motion(0.0)
    motion = (per_motion(0.4), no_turn, per_motion(speed), per_motion(acceleration), no_time)
    expected_speed, expected_acceleration = played(0.4, speed, acceleration)
    fine = tool_motions(along(0.4, 4001), *motion)
    assert fine.speed[0] == pytest.approx(expected_speed, rel=2e-3)
    assert fine.acceleration[0] == pytest.approx(expected_acceleration, rel=2e-3)
    coarse = tool_motions(along(0.4, 17), *motion)
    assert (coarse.speed[0] <= 1.02 * expected_speed).all()
    assert (coarse.speed[0] >= 0.85 * expected_speed).all()
    assert (coarse.acceleration[0] <= 1.02 * expected_acceleration).all()


def test_constant_speed_where_no_acceleration_is_stated():
    motion = (per_motion(0.4), per_motion(0.0))
    stated = tool_motions(along(0.4, 4001), *motion, per_motion(0.5), per_motion(NAN), per_motion(NAN))
    timed = tool_motions(along(0.4, 4001), *motion, per_motion(9.0), per_motion(9.0), per_motion(0.8))
    for rates in (stated, timed):  # q' = (10 s, 3.6 cos 12 s), q'' = (10, -43.2 sin 12 s)
        assert rates.speed[0] == pytest.approx([4.0 * 0.5, 3.6 * 0.5], rel=1e-3)
        assert rates.acceleration[0] == pytest.approx([10 * 0.25, 43.2 * 0.25], rel=1e-3)


def test_a_turn_on_the_spot_takes_its_time():
    """0.1 m/s count as 0.4 rad/s: the wrist that turns the tool by 1 rad does so at 0.4 rad/s."""
    q = np.linspace([0.0, 0.0], [0.0, 1.0], 21)[None]
    rates = tool_motions(q, per_motion(0.0), per_motion(1.0), per_motion(0.1), per_motion(NAN), per_motion(NAN))
    assert rates.speed[0] == pytest.approx([0.0, 0.4])
    with_way = tool_motions(q, per_motion(1.0), per_motion(1.0), per_motion(0.1), per_motion(NAN), per_motion(NAN))
    assert with_way.speed[0] == pytest.approx([0.0, 0.1])


def test_a_tool_that_stands_still_and_one_of_unknown_speed_are_not_judged():
    q = np.repeat(along(0.4, 21), 2, axis=0)
    rates = tool_motions(
        q, per_motion(0.0, 0.4), per_motion(0.0, 0.0), per_motion(0.1, NAN), per_motion(1.0, 1.0), per_motion(NAN, NAN)
    )
    assert np.isnan(rates.speed).all()
    assert np.isnan(rates.acceleration).all()


def test_a_way_of_two_samples_is_refused():
    one = per_motion(1.0)
    with pytest.raises(ValueError, match="three or more"):
        tool_motions(ends([1.0, 1.0]), one, one, one, one, one)


def test_a_line_of_a_ur5_by_drakes_jacobian(ur5):
    """A line that brings the wrist close to where joints 4 and 6 are in line: they spin."""
    start, length, speed, samples = HOME.copy(), 0.3, 0.25, 301
    start[4] += 1.3
    X = np.repeat(nominal_flange_poses(ur5, start[None]), samples, axis=0)
    direction = np.array([0.0, 1.0, 0.0])
    X[:, :3, 3] += np.linspace(0, length, samples)[:, None] * direction
    q = solve(nominal_model(ur5).flange_poses_and_jacobian, X, np.repeat(start[None], samples, axis=0))
    assert q.converged.all()
    q = q.q_rad
    assert np.abs(np.diff(q, axis=0)).max() < 0.05
    constant = (per_motion(length), per_motion(0.0), per_motion(speed), per_motion(NAN), per_motion(NAN))
    rates = tool_motions(q[None], *constant)
    assert rates.speed.max() > 1.0
    assert rates.speed[0] == pytest.approx(drake_joint_speeds(q, speed * direction).max(axis=0), rel=0.02)


def drake_joint_speeds(q_rad, v_BF):
    """``(N, n)`` for a flange that moves at ``(3,)`` m/s in the base without turning."""
    from pydrake.multibody.tree import JacobianWrtVariable

    arm = DrakeArm("ur5")
    speeds = []
    for q in q_rad:
        arm.plant.SetPositions(arm.context, q)
        J = arm.plant.CalcJacobianSpatialVelocity(
            arm.context, JacobianWrtVariable.kV, arm.arm.flange, np.zeros(3), arm.arm.base, arm.arm.base
        )
        speeds.append(np.abs(np.linalg.solve(J, [0, 0, 0, *v_BF])))
    return np.array(speeds)


# Joints at a fixed rate


def test_joints_at_a_fixed_rate():
    q = ends([0.02, 0.0], [0.03, -0.01], [0.03, -0.01])
    rates = servo_motions(q, per_motion(0.01, 0.01, 0.02))
    assert rates.speed == pytest.approx(np.array([[2.0, 0.0], [3.0, 1.0], [1.5, 0.5]]))
    assert np.isnan(rates.acceleration[0]).all()  # nobody knows how fast the robot was before
    assert rates.acceleration[1:] == pytest.approx(np.array([[100.0, 100.0], [100.0, 0.5 / 0.015]]))


def test_a_motion_that_starts_elsewhere_continues_nothing():
    q = ends([0.02, 0.0], [0.03, 0.0])
    q[1] += 0.1
    assert np.isnan(servo_motions(q, per_motion(0.01, 0.01)).acceleration).all()


def test_no_time_no_speed():
    rates = servo_motions(ends([0.02, 0.0], [0.03, 0.0]), per_motion(NAN, 0.0))
    assert np.isnan(rates.speed).all()


# Findings


@pytest.fixture(scope="module")
def limited(ur5):
    """Joint 1 slow, joint 6 without limits."""
    velocity = np.array([1.0, 2.0, 2.0, 2.0, 2.0, np.inf])
    return replace(ur5, velocity_rad_s=velocity, acceleration_rad_s2=np.where(np.isinf(velocity), np.inf, 5.0))


def one_motion(speed, acceleration=0.0):
    return Rates(np.array([speed], float), np.full((1, 6), acceleration, float))


def test_a_limit_that_the_correction_passes_is_an_error(limited):
    before, after = one_motion([0.9, 1, 1, 1, 1, 50]), one_motion([1.1, 1, 1, 1, 1, 60])
    (finding,) = rate_findings(before, after, limited, np.array([33]))
    assert (finding.level, finding.guard, finding.line) == ("error", "joint-speed", 33)
    assert (finding.value, finding.limit, finding.unit) == (1.1, 1.0, "rad/s")
    assert finding.message == (
        "q1 (shoulder_pan_joint): speed 1.1 rad/s after the correction, 0.9 before; its limit is 1"
    )


def test_a_limit_that_the_program_passes_by_itself_is_a_warning(limited):
    before, after = one_motion([1.2, 2.2, 1, 1, 1, 1]), one_motion([1.3, 2.3, 1, 1, 1, 1])
    (finding,) = rate_findings(before, after, limited, np.array([33]))
    assert (finding.level, finding.value, finding.limit) == ("warning", 1.2, 1.0)
    assert "in the program itself" in finding.message


def test_what_the_correction_does_is_told_first(limited):
    before, after = one_motion([5.0, 1.9, 1, 1, 1, 1]), one_motion([5.0, 2.1, 1, 1, 1, 1])
    (finding,) = rate_findings(before, after, limited, np.array([33]))
    assert (finding.level, finding.value) == ("error", 2.1)


@pytest.mark.parametrize("after", [[1.0 + 1e-9, 2, 2, 2, 2, 99], [NAN] * 6, [0.5] * 6])
def test_limits_that_are_kept_or_cannot_be_judged(limited, after):
    assert rate_findings(one_motion([0.9] * 6), one_motion(after), limited, np.array([1])) == []


def test_accelerations_beyond_what_the_model_states_are_a_warning(limited):
    slow = [0.1] * 6
    findings = rate_findings(one_motion(slow, 4.0), one_motion(slow, 6.0), limited, np.array([7]))
    assert [(finding.guard, finding.level, finding.unit) for finding in findings] == [
        ("joint-acceleration", "warning", "rad/s^2")
    ]


def test_each_motion_has_its_own_findings(limited):
    before = Rates(np.full((3, 6), 0.5), np.full((3, 6), NAN))
    after = Rates(np.array([[0.5] * 6, [3.0] * 6, [2.5] * 6]), np.full((3, 6), NAN))
    findings = rate_findings(before, after, limited, np.array([4, 8, 9]))
    assert [finding.line for finding in findings] == [8, 9]


def test_a_joint_that_must_not_move(limited):
    locked = replace(limited, velocity_rad_s=np.array([0.0, 2, 2, 2, 2, 2]))
    assert rate_findings(one_motion([0] * 6), one_motion([0] * 6), locked, np.array([1])) == []
    (finding,) = rate_findings(one_motion([0] * 6), one_motion([0.1, 3, 0, 0, 0, 0]), locked, np.array([1]))
    assert finding.message.startswith("q1")
