"""The paper's own use: from joints straight to the position, without kinematics."""

import numpy as np
import pytest
from drake_arm import DrakeArm
from truepath.residual.direct import learn_direct
from truepath.residual.limits import Limits, Settings
from truepath.residual.options import Options

QUICK = Options(evolution=Settings(individuals=10, smallest=15, largest=20, generations=10), limits=Limits(150, 40))
CENTRE = np.array([0.2, -1.2, 1.1, -0.7, 0.9, 0.3])
FAR_AWAY = np.array([2500.0, -300.0, 40.0])


@pytest.fixture(scope="module")
def arm():
    return DrakeArm("ur5", seed=1)


@pytest.fixture(scope="module")
def poses(arm):
    """Joints within 0.3 rad and positions of the flange, as a tracker far away sees them."""
    q = CENTRE + 0.3 * np.random.default_rng(0).uniform(-1, 1, (500, 6))
    return q, arm.flange_poses(q)[:, :3, 3] + FAR_AWAY


@pytest.fixture(scope="module")
def learnt(poses):
    return learn_direct(*poses, options=QUICK)


def test_positions_of_fresh_poses_are_predicted_in_the_frame_of_the_tracker(arm, learnt):
    fresh = CENTRE + 0.28 * np.random.default_rng(1).uniform(-1, 1, (300, 6))
    truth = arm.flange_poses(fresh)[:, :3, 3] + FAR_AWAY
    miss = np.linalg.norm(learnt.predict(fresh) - truth, axis=1)
    assert miss.mean() < 1e-3
    assert miss.mean() < 0.01 * np.linalg.norm(truth - truth.mean(axis=0), axis=1).mean()


def test_the_number_of_hidden_neurons_is_one_that_was_allowed(learnt):
    assert 15 <= learnt.hidden <= 20
    assert learnt.network.hidden.shape == (learnt.hidden, 7)
    assert len(learnt.network.bias) == 3


def test_the_same_seed_gives_the_same_bits_another_seed_others(poses, learnt):
    q, p = poses
    np.testing.assert_array_equal(learn_direct(q, p, options=QUICK).predict(q), learnt.predict(q))
    assert np.abs(learn_direct(q, p, 1, options=QUICK).predict(q) - learnt.predict(q)).max() > 0


def test_all_three_coordinates_count_alike(learnt):
    """The paper's error (eq. 15) is a length: a metre along x is no less than a metre along z."""
    assert len(set(learnt.scale_m)) == 1


def test_a_joint_that_never_moved_is_no_trouble(poses):
    q, p = poses
    still = q.copy()
    still[:, 5] = 0.4
    assert np.isfinite(learn_direct(still, p, options=QUICK).predict(still)).all()


def test_progress_tells_the_generation(poses):
    told = []
    learn_direct(*poses, options=QUICK, progress=told.append)
    assert told[0] == "generation 1"
    assert len(told) == 10
