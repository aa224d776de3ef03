"""The calibrated robot with effects of every kind: where its probe goes, by Drake and by formulas written here."""

from dataclasses import replace

import numpy as np
import pytest
from drake_arm import DrakeArm
from scipy.spatial.transform import Rotation
from truepath.context import Context
from truepath.effects.base import EffectParameter, FittedTerm, Term
from truepath.model import CalibratedModel, no_deviation, nominal_model
from truepath.motions import Moves

POSES = 20


def pose(vector, translation):
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.from_rotvec(vector).as_matrix(), translation
    return X


X_MB = pose([0.4, -1.1, 2.0], [3.0, -1.0, 0.5])
X_FE = pose([-0.7, 0.2, 0.9], [0.05, -0.02, 0.13])


def term(effect, moves, joint, inputs, constants, *values):
    """A fitted term; values are pairs of a parameter's name and its size."""
    parameters = tuple(EffectParameter(name, "any", 1e-4, "any") for name, _ in values)
    numbers = np.array([value for _, value in values])
    return FittedTerm(Term(effect, moves, joint, inputs, tuple(constants.items()), parameters), numbers)


WIDE = {"lower_rad": -4.0, "upper_rad": 4.0}
SOFT = term("joint_compliance", Moves.JOINT, 2, ("gravity_torque",), WIDE, ("compliance", 2e-5))
SCALE = term("encoder_scale", Moves.JOINT, 5, ("theta",), WIDE, ("scale", 3e-4))
GROWTH = term(
    *("thermal_expansion", Moves.ROBOT_LENGTHS, None, ("temperature_c",)),
    {"reference_c": 22.0, "default temperature_c": 22.0},
    ("expansion", 2e-5),
)
METRE = term("measurement_scale", Moves.MEASURED_LENGTHS, None, (), {}, ("scale", 2e-4))
SLIP = term(
    *("tool_shift", Moves.PROBE, None, ("time_s",), {"moment": 100.0, "default time_s": 200.0}),
    *(("x", 3e-4), ("z", -2e-4), ("ry", 1e-3)),
)
DRIFT = term(
    *("frame_drift", Moves.BASE, None, ("time_s",), {"start": 0.0, "end": 200.0}),
    *(("x order 1", 2e-4), ("rz order 1", 1e-4)),
)
WOBBLE = term("axis_wobble", Moves.AXIS, 1, ("theta",), WIDE, ("z cos 1", 1e-4))
CREEP = term(
    *("warmup_drift", Moves.JOINT, 1, ("time_s",)),
    {"tau_s": 50.0, "start": 0.0, "end": 200.0, "default time_s": 200.0},
    ("creep", 4e-4),
)
EVERY = (SOFT, SCALE, GROWTH, METRE, SLIP, DRIFT, WOBBLE, CREEP)


@pytest.fixture(scope="module")
def joints():
    return np.random.default_rng(0).uniform(-2, 2, (POSES, 6))


@pytest.fixture(scope="module")
def drake():
    return DrakeArm("ur5")


@pytest.fixture(scope="module")
def having(ur5):
    """Function: the nominal UR5 with some effects, its probe and the tracker askew."""

    def having(*effects, **more):
        return CalibratedModel(ur5, no_deviation(ur5), X_MB, X_FE, X_MB, X_FE, effects=effects, **more)

    return having


def seen(X_BF):
    """``(N, 4, 4)`` probe poses for flange poses."""
    return X_MB @ X_BF @ X_FE


# Joints


def test_without_effects_joints_are_where_they_are_told_to_be(having, joints, drake):
    np.testing.assert_array_equal(having().true_joints(joints), joints)
    np.testing.assert_allclose(having().predict(joints), seen(drake.flange_poses(joints)), atol=1e-12)


def test_effects_that_turn_joints_enter_the_kinematics_as_joint_angles(having, joints, drake):
    model = having(SCALE)
    turned = joints * [1, 1, 1, 1, 1 + 3e-4, 1]
    np.testing.assert_allclose(model.true_joints(joints), turned, atol=1e-15)
    np.testing.assert_allclose(model.flange_poses(joints), drake.flange_poses(turned), atol=1e-12)
    np.testing.assert_allclose(model.predict(joints), seen(drake.flange_poses(turned)), atol=1e-12)


def test_the_nominal_prediction_knows_of_no_effect(having, joints, drake):
    np.testing.assert_allclose(having(*EVERY).predict_nominal(joints), seen(drake.flange_poses(joints)), atol=1e-12)


# Payload


def test_a_pose_without_a_payload_carries_what_the_robot_carried_when_it_was_calibrated(having, joints):
    loaded = having(SOFT, payload_kg=4.0)
    np.testing.assert_array_equal(loaded.predict(joints), having(SOFT).predict(Context(joints, 4.0)))
    assert np.abs(loaded.predict(joints) - having(SOFT).predict(joints)).max() > 1e-4


def test_a_pose_with_a_payload_of_its_own_carries_that_one(having, joints, ur5):
    kg = np.linspace(0, 5, POSES)
    found = having(SOFT, payload_kg=4.0).true_joints(Context(joints, kg)) - joints
    np.testing.assert_allclose(found[:, 1], 2e-5 * ur5.gravity_torque(joints, kg)[:, 1], atol=1e-15)
    np.testing.assert_array_equal(
        having(SOFT, payload_kg=4.0).predict(Context(joints, 0.0)), having(SOFT).predict(joints)
    )


def test_a_calibration_can_be_told_of_another_payload(having, joints):
    model = replace(having(SOFT, payload_kg=4.0), payload_kg=1.0)
    np.testing.assert_array_equal(model.predict(joints), having(SOFT).predict(Context(joints, 1.0)))


# Lengths


def test_a_warm_robot_reaches_further(having, joints, drake):
    temperature = np.linspace(15, 40, POSES)
    longer = drake.flange_poses(joints)
    longer[:, :3, 3] *= 1 + 2e-5 * (temperature - 22.0)[:, None]
    found = having(GROWTH).predict(Context(joints, temperature_c=temperature))
    np.testing.assert_allclose(found, seen(longer), atol=1e-12)


def test_without_a_temperature_it_is_as_warm_as_it_was_measured(having, joints, drake):
    np.testing.assert_allclose(having(GROWTH).predict(joints), seen(drake.flange_poses(joints)), atol=1e-12)


def test_growth_moves_the_flange_and_a_wrong_metre_only_the_readings(having, joints, drake):
    warm = Context(joints, temperature_c=np.full(POSES, 42.0))
    flange = drake.flange_poses(joints)
    assert np.abs(having(GROWTH).flange_poses(warm) - flange).max() > 1e-4
    np.testing.assert_allclose(having(METRE).flange_poses(joints), flange, atol=1e-12)
    expected = seen(flange)
    expected[:, :3, 3] *= 1 + 2e-4
    np.testing.assert_allclose(having(METRE).predict(joints), expected, atol=1e-12)


# Axes


def test_an_axis_that_slides_lifts_all_that_it_carries(having, joints, drake):
    """Axis 1 of the UR5 stands upright on the base."""
    lifted = drake.flange_poses(joints)
    lifted[:, 2, 3] += 1e-4 * np.cos(joints[:, 0])
    np.testing.assert_allclose(having(WOBBLE).flange_poses(joints), lifted, atol=1e-12)


def test_the_jacobian_comes_with_the_very_flange_poses_that_the_model_predicts(having, joints):
    for model in (having(SCALE), having(WOBBLE, SCALE)):
        X_BF, jacobian = model.flange_poses_and_jacobian(joints)
        np.testing.assert_array_equal(X_BF, model.flange_poses(joints))
        assert jacobian.shape == (POSES, 6, 6)


# Time


def test_the_probe_slips_at_its_moment_along_the_axes_of_the_flange(having, joints, drake):
    time = np.linspace(0, 200, POSES)
    before = seen(drake.flange_poses(joints))
    R_MF = X_MB[:3, :3] @ drake.flange_poses(joints)[:, :3, :3]
    found = having(SLIP).predict(Context(joints, time_s=time))
    shift = R_MF @ [3e-4, 0, -2e-4]
    np.testing.assert_allclose(found[time <= 100], before[time <= 100], atol=1e-12)
    late = time > 100
    np.testing.assert_allclose((found - before)[late, :3, 3], shift[late], atol=1e-12)
    turn = Rotation.from_matrix(found[:, :3, :3] @ np.swapaxes(before[:, :3, :3], 1, 2)).as_rotvec()
    np.testing.assert_allclose(turn[late], (R_MF @ [0, 1e-3, 0])[late], atol=1e-12)


def test_the_base_drifts_and_carries_the_robot_along(having, joints, drake):
    u = np.linspace(-1, 1, POSES)
    found = having(DRIFT).predict(Context(joints, time_s=100.0 * (u + 1)))
    for X, X_BF, progress in zip(found, drake.flange_poses(joints), u, strict=True):
        moved = X_MB @ pose([0, 0, 1e-4 * progress], [2e-4 * progress, 0, 0]) @ X_BF @ X_FE
        np.testing.assert_allclose(X, moved, atol=2e-8)  # second order is left out


def test_a_pose_without_a_time_is_one_of_today(having, joints):
    """Slipped, warm; only the base is where it was on average."""
    today, last = joints, Context(joints, time_s=np.full(POSES, 200.0))
    for effect in (SLIP, CREEP):
        np.testing.assert_array_equal(having(effect).predict(today), having(effect).predict(last))
    np.testing.assert_array_equal(having(DRIFT).predict(today), having().predict(today))


def test_circumstances_of_one_pose_do_not_reach_its_neighbours(having, joints):
    model = having(*EVERY, payload_kg=1.0)
    rng = np.random.default_rng(1)
    whole = Context(
        joints, rng.uniform(0, 4, POSES), time_s=np.linspace(0, 250, POSES), temperature_c=rng.uniform(15, 35, POSES)
    )
    together = model.predict(whole)
    for k in range(POSES):
        np.testing.assert_allclose(model.predict(whole.subset(np.array([k])))[0], together[k], atol=1e-14)


# Frames


def test_the_frames_of_today_predict_what_the_whole_model_does(having, joints):
    """Whoever takes the frames as they are now, and a model without moving frames, sees the same."""
    for effects in ((SLIP,), (DRIFT,), (SLIP, DRIFT), (SLIP, SOFT, WOBBLE)):
        model = having(*effects)
        X_MB_now, X_FE_now = model.frames_now()
        still = replace(
            model,
            X_MB=X_MB_now,
            X_FE=X_FE_now,
            effects=tuple(e for e in effects if e.term.moves not in (Moves.BASE, Moves.PROBE)),
        )
        np.testing.assert_allclose(still.predict(joints), model.predict(joints), atol=1e-7)


def test_frames_that_nothing_moves_are_those_of_the_calibration(having):
    X_MB_now, X_FE_now = having(SOFT, GROWTH, METRE, WOBBLE).frames_now()
    np.testing.assert_array_equal(X_MB_now, X_MB)
    np.testing.assert_array_equal(X_FE_now, X_FE)


def test_a_stated_probe_that_slipped_is_made_up_for_by_the_flange(having, joints, drake):
    """With the slipped probe, the corrected flange must bring it to where the program means it."""
    model = having(SLIP, tool_is_given=True)
    programmed = drake.flange_poses(joints)
    goal = model.goal_flange_poses(programmed)
    np.testing.assert_allclose(goal @ model.frames_now()[1], programmed @ X_FE, atol=1e-12)
    assert np.abs(goal - programmed).max() > 1e-4


def test_every_prediction_is_a_rigid_pose(having, joints):
    for X in (having(*EVERY).predict(joints), having(*EVERY).flange_poses(joints)):
        R = X[:, :3, :3]
        np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-12)
        np.testing.assert_array_equal(X[:, 3], np.broadcast_to([0, 0, 0, 1], (POSES, 4)))


def test_a_nominal_model_predicts_the_nominal_robot(ur5, joints, drake):
    model = nominal_model(ur5, X_MB, X_FE)
    np.testing.assert_allclose(model.predict(joints), seen(drake.flange_poses(joints)), atol=1e-12)
