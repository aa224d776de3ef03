"""Several networks as a part of the robot's model: their mean, their spread, what they do to flange and correction."""

from dataclasses import replace

import numpy as np
import pytest
from by_loop import output_by_loop, random_network
from drake_arm import DrakeArm
from scipy.spatial.transform import Rotation
from truepath.correct import correct
from truepath.model import nominal_flange_poses, nominal_model
from truepath.residual.ensemble import NetworkResidual
from truepath.residual.reach import Reach

CENTRE = np.array([0.2, -1.2, 1.1, -0.7, 0.9, 0.3])
P_FE = np.array([0.03, -0.02, 0.05])


def residual_of(outputs, members=3, seed=0, count=200):
    """Networks with random weights, of different size, over a box of joints."""
    rng = np.random.default_rng(seed)
    networks = tuple(random_network(rng, 6, 4 + 2 * number, outputs) for number in range(members))
    scale = np.repeat([3e-4, 2e-4], 3)[:outputs]
    return NetworkResidual(networks, scale, Reach.of(CENTRE + rng.uniform(-1, 1, (count, 6))))


@pytest.fixture(scope="module", params=[3, 6], ids=["3D", "6D"])
def residual(request):
    return residual_of(request.param)


@pytest.fixture(scope="module")
def joints():
    """Of which some lie inside what was measured, some outside, some between."""
    return CENTRE + np.random.default_rng(7).uniform(-1.25, 1.25, (300, 6))


@pytest.fixture(scope="module")
def drake_ur5():
    return DrakeArm("ur5")


@pytest.fixture(scope="module")
def model(ur5, residual):
    """A perfect UR5 but for the networks; the probe sits askew on the flange, the tracker somewhere."""
    X_FE, X_MB = np.eye(4), np.eye(4)
    X_FE[:3, :3], X_FE[:3, 3] = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix(), P_FE
    X_MB[:3, :3], X_MB[:3, 3] = Rotation.from_rotvec([0.1, 0.2, -2.0]).as_matrix(), [2.0, -1.0, 0.3]
    return replace(nominal_model(ur5, X_MB, X_FE), residual=residual)


# Mean and spread


def test_the_shift_is_the_mean_of_all_networks_in_metres_times_the_weight(residual, joints):
    middle = 0.5 * (residual.reach.lower_rad + residual.reach.upper_rad)
    x = (joints - middle) / (0.5 * (residual.reach.upper_rad - residual.reach.lower_rad))
    mean = sum(output_by_loop(network, x) for network in residual.networks) / len(residual.networks)
    expected = np.zeros((len(joints), 6))
    expected[:, : len(residual.scale)] = mean * residual.scale * residual.weight(joints)[:, None]
    np.testing.assert_allclose(residual.shift(joints), expected, atol=1e-15)
    assert 0.05 < (residual.weight(joints) == 0).mean() < 0.95


def test_where_orientations_were_not_measured_nothing_turns(joints):
    assert (residual_of(3).shift(joints)[:, 3:] == 0).all()


def test_the_spread_is_the_standard_deviation_between_the_networks_over_all_three_coordinates(residual, joints):
    middle = 0.5 * (residual.reach.lower_rad + residual.reach.upper_rad)
    x = (joints - middle) / (0.5 * (residual.reach.upper_rad - residual.reach.lower_rad))
    said = np.array([output_by_loop(network, x)[:, :3] * residual.scale[:3] for network in residual.networks])
    misses = np.linalg.norm(said - said.mean(axis=0), axis=2)
    expected = np.sqrt((misses**2).sum(axis=0) / (len(said) - 1)) * residual.weight(joints)
    np.testing.assert_allclose(residual.spread(joints), expected, atol=1e-15)


@pytest.mark.parametrize("members", [1, 2, 5])
def test_equal_networks_have_no_spread_and_say_what_one_says(residual, joints, members):
    equal = replace(residual, networks=residual.networks[:1] * members)
    assert equal.spread(joints).max() < 1e-18
    alone = replace(residual, networks=residual.networks[:1])
    np.testing.assert_allclose(equal.shift(joints), alone.shift(joints), atol=1e-18)


def test_where_the_data_did_not_reach_nothing_is_said_and_nothing_is_nan(residual):
    for far in (np.full((1, 6), 1e9), CENTRE[None] + 2.0, np.zeros((0, 6))):
        for values in (residual.shift(far), residual.spread(far), residual.weight(far)):
            assert (values == 0).all()


# In the model


def test_the_probe_moves_and_turns_by_exactly_the_shift(model, residual, drake_ur5, joints):
    """The undisturbed robot comes from Drake; shift and turn are told in its base."""
    plain = drake_ur5.flange_poses(joints) @ model.X_FE
    moved, shift = model.flange_poses(joints) @ model.X_FE, residual.shift(joints)
    assert np.linalg.norm(shift[:, :3], axis=1).max() > 1e-4
    np.testing.assert_allclose(moved[:, :3, 3] - plain[:, :3, 3], shift[:, :3], atol=1e-12)
    turned = np.einsum("nij,nkj->nik", moved[:, :3, :3], plain[:, :3, :3])
    np.testing.assert_allclose(Rotation.from_matrix(turned).as_rotvec(), shift[:, 3:], atol=1e-12)


def test_a_tracker_sees_the_shift_in_its_own_frame(model, residual, drake_ur5, joints):
    plain = model.X_MB @ drake_ur5.flange_poses(joints) @ model.X_FE
    seen = model.predict(joints)[:, :3, 3] - plain[:, :3, 3]
    np.testing.assert_allclose(seen, residual.shift(joints)[:, :3] @ model.X_MB[:3, :3].T, atol=1e-12)


def test_the_flange_stays_a_rigid_pose(model, joints):
    X = model.flange_poses(joints)
    np.testing.assert_allclose(
        X[:, :3, :3] @ np.swapaxes(X[:, :3, :3], 1, 2), np.eye(3)[None].repeat(300, 0), atol=1e-12
    )
    np.testing.assert_array_equal(X[:, 3], np.tile([0, 0, 0, 1.0], (300, 1)))


def test_the_nominal_robot_knows_nothing_of_networks(model, drake_ur5, joints):
    expected = model.X_MB @ drake_ur5.flange_poses(joints) @ model.X_FE
    np.testing.assert_allclose(model.predict_nominal(joints), expected, atol=1e-12)


# Correction


BEYOND = np.array([0.9, 0.1, 0.1, 1.4, 0.1, 0.0])  # from the centre; joint 4 ends 20 degrees beyond


@pytest.fixture(scope="module")
def path():
    """A line in joint space from the middle of what was measured to beyond it."""
    return CENTRE + np.linspace(0, 1, 400)[:, None] * BEYOND


def test_the_corrected_robot_with_networks_is_within_a_micrometre_of_the_intent(model, path):
    correction = correct(model, path)
    reached, meant = (
        (model.flange_poses(correction.q_rad) @ model.X_FE),
        nominal_flange_poses(model.robot, path) @ model.X_FE,
    )
    assert np.linalg.norm(reached[:, :3, 3] - meant[:, :3, 3], axis=1).max() < 1e-6
    turned = np.einsum("nij,nkj->nik", reached[:, :3, :3], meant[:, :3, :3])
    assert np.linalg.norm(Rotation.from_matrix(turned).as_rotvec(), axis=1).max() < 1e-6
    assert correction.error_before_mm.max() > 0.05


def test_correction_stays_continuous_where_the_data_end(model, residual, path):
    weight = residual.weight(path)
    assert weight[0] > 0.999
    assert weight[-1] == 0
    correction = correct(model, path)
    added = correction.q_rad - path
    assert np.abs(np.diff(added, axis=0)).max() < 1e-4
    assert np.abs(added[weight == 0]).max() < 1e-9
    finer = CENTRE + np.linspace(0, 1, 3991)[:, None] * BEYOND
    steps, fine_steps = (np.abs(np.diff(correct(model, q).q_rad - q, axis=0)).max() for q in (path, finer))
    assert fine_steps < 0.2 * steps  # a jump would not become smaller on a finer path
