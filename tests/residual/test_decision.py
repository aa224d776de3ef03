"""A network enters the calibration where it is proved to help, and nowhere else; Drake knows the truth."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from odd_robot import QUICK, arm, campaign, joints, mean_error_mm, true_positions
from truepath.calibrate import calibrate
from truepath.context import Context
from truepath.diagnosis import Gain
from truepath.kept_away import KeptAway
from truepath.learn import learn, with_network
from truepath.residual import decision as module
from truepath.residual import proof
from truepath.residual.decision import TOO_FEW, decide
from truepath.residual.ensemble import NetworkResidual
from truepath.residual.proof import Proof, cross_validated
from truepath.splits import BLOCKS_PER_PART, random_parts


def also_slow(seed):
    """More of the same, for those who have time."""
    return pytest.param(seed, marks=pytest.mark.slow)


@pytest.fixture(scope="module")
def odd():
    """A robot with an error that no cause explains, 0.1 mm."""
    return arm(3)


@pytest.fixture(scope="module")
def learnt(ur5, odd):
    """From 300 poses of it."""
    return learn(ur5, campaign(odd, joints(300, 1), seed=1), network=QUICK)


@pytest.fixture(scope="module")
def fresh(odd):
    """Poses that nothing has seen, and where the probe really is there."""
    q = joints(400, 2)
    return q, true_positions(odd, q)


# It enters


def test_where_there_is_something_to_learn_more_than_half_of_it_is_gained_on_fresh_poses(learnt, fresh):
    model = learnt.calibration.model
    without, with_it = mean_error_mm(replace(model, residual=None), *fresh), mean_error_mm(model, *fresh)
    assert without > 0.06
    assert with_it < 0.5 * without
    assert learnt.network.startswith("in the model: on poses that it did not learn from")


def test_what_the_spread_says_is_of_the_size_of_what_is_left(learnt, fresh):
    model = learnt.calibration.model
    spread = 1e3 * model.residual.spread(fresh[0]).mean()
    assert 0.2 < spread / mean_error_mm(model, *fresh) < 3


def test_the_calibration_says_what_proved_it(learnt):
    proof = learnt.calibration.residual.proof
    assert proof.p_value < 0.01
    assert proof.after_mm < proof.before_mm
    assert f"{proof.before_mm:.4f} to {proof.after_mm:.4f} mm" in learnt.network


def test_the_networks_in_the_file_are_as_many_as_were_asked_for(learnt):
    assert len(learnt.calibration.residual.networks) == QUICK.members


# Held-out numbers


def test_held_out_numbers_come_from_poses_that_nobody_has_seen(ur5, odd):
    """Whatever is done to the readings of these poses, fits and networks that are judged on them do not change."""
    data = campaign(odd, joints(100, 1), size_m=2e-4, seed=1)
    unseen = np.isin(np.arange(100), data.folds(5)[0])
    other = 1e-4 * np.random.default_rng(0).normal(size=(100, 3)) * unseen[:, None]
    seen_by = []
    for p_ME in (data.p_ME, data.p_ME + other):
        changed = replace(data, p_ME=p_ME)
        trial = KeptAway(changed, Context.of(changed), unseen)
        decided = decide(trial, _fit(ur5, changed), QUICK)
        seen_by.append((decided.proof, decided.model.predict(data.q_rad)))
    assert seen_by[0][0] == seen_by[1][0]
    np.testing.assert_array_equal(seen_by[0][1], seen_by[1][1])


def _fit(robot, data):
    return lambda rows, drifting: calibrate(robot, data.subset(rows)).model


def test_the_accuracy_stated_for_new_poses_is_the_one_they_turn_out_to_have(learnt, fresh, odd):
    """Held-out errors are against readings: their noise of 0.02 mm per axis is in them."""
    q, truth = fresh
    readings = truth + 2e-5 * np.random.default_rng(5).normal(size=truth.shape)
    held_out, model = learnt.calibration.heldout, learnt.calibration.model
    assert held_out.poses == 60
    assert "kept away" in held_out.method
    assert "networks" in held_out.method
    assert held_out.calibrated.position_mm.mean == pytest.approx(mean_error_mm(model, q, readings), rel=0.3)
    without = mean_error_mm(replace(model, residual=None), q, readings)
    assert held_out.kinematic.position_mm.mean == pytest.approx(without, rel=0.2)
    assert held_out.named is None  # there are no named effects


# It does not enter


@pytest.mark.parametrize("seed", [0, 1, *map(also_slow, (2, 3, 4))])
def test_of_a_robot_with_nothing_but_noise_it_is_left_out_and_says_why(ur5, seed):
    data = campaign(arm(seed), joints(100, seed), size_m=0.0, seed=seed)
    learnt = learn(ur5, data, network=QUICK)
    assert learnt.calibration.residual is None
    assert learnt.fit.model.residual is None
    assert learnt.network.startswith("left out: ")
    assert "mm" in learnt.network
    assert "p = " in learnt.network or "kept away" in learnt.network


def test_a_calibration_from_which_it_is_left_out_is_the_one_without(ur5):
    data = campaign(arm(0), joints(60, 0), size_m=0.0, seed=0)
    with_it, without = learn(ur5, data, network=QUICK).calibration, learn(ur5, data).calibration
    moment = {"created_utc": ""}
    assert with_it.model_copy(update=moment) == without.model_copy(update=moment)


@pytest.mark.parametrize("seed", [0, also_slow(3)])  # where so small an evolution learns the groups
def test_what_close_neighbours_in_time_have_in_common_is_not_taken_for_something_that_goes_with_the_pose(ur5, seed):
    """Poses measured one after the other lie close together, and the tracker moved between the groups.

    A pose left out at random is predicted by the others of its group; left out in blocks it is not.
    """
    rng, groups = np.random.default_rng(seed), 5 * BLOCKS_PER_PART
    q = np.repeat(joints(groups, seed), 4, axis=0) + 0.03 * rng.uniform(-1, 1, (4 * groups, 6))
    drift = np.repeat(1e-4 * rng.normal(size=(groups, 3)), 4, axis=0)
    data = campaign(arm(seed), q, size_m=0.0, seed=seed, drift=drift)
    trial = KeptAway(data, Context.of(data), np.zeros(len(q), bool))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proof, "block_parts", lambda rows, count: random_parts(np.arange(rows), count, 1))
        assert cross_validated(trial, _fit(ur5, data), QUICK).holds
    assert not cross_validated(trial, _fit(ur5, data), QUICK).holds


@pytest.mark.parametrize("seed", [0, also_slow(1)])
def test_a_slow_drift_is_not_taken_for_something_that_goes_with_the_pose_where_poses_were_measured_in_order(ur5, seed):
    """Sorted by joint 1, the pose tells the time; a network must be better than the time alone."""
    q = joints(250, seed)
    q = q[np.argsort(q[:, 0])]
    t = np.linspace(0, 3 * np.pi, len(q))
    drift = 1e-4 * np.stack([np.sin(t), np.cos(t + seed), np.sin(0.7 * t)], axis=1)
    data = campaign(arm(seed), q, size_m=0.0, seed=seed, drift=drift)
    trial = KeptAway(data, Context.of(data), np.zeros(len(q), bool))

    def fit(rows, drifting, allowed=True):
        names = ("frame_drift",) if drifting and allowed else ()
        return calibrate(ur5, data.subset(rows), names).model

    assert cross_validated(trial, partial(fit, allowed=False), QUICK).holds
    assert not cross_validated(trial, fit, QUICK).holds
    assert learn(ur5, data, network=QUICK).calibration.residual is None


@pytest.mark.parametrize("count", [12, 30, 36])
def test_of_too_few_poses_nothing_is_learnt(ur5, odd, count):
    learnt = learn(ur5, campaign(odd, joints(count, 1), seed=1), network=QUICK)
    assert learnt.calibration.residual is None
    assert learnt.network == TOO_FEW


@pytest.mark.parametrize("seed", [0, also_slow(1)])
def test_noise_of_the_orientations_is_no_reason_to_leave_networks_out(ur5, seed):
    data = campaign(arm(seed), joints(150, seed), seed=seed, turn_noise_mrad=0.1)
    learnt = learn(ur5, data, network=QUICK)
    assert learnt.network.startswith("in the model: ")
    held_out = learnt.calibration.heldout
    assert held_out.calibrated.orientation_mrad.mean < 1.05 * held_out.kinematic.orientation_mrad.mean


def test_a_gain_in_position_that_costs_orientation_is_not_accepted(ur5, odd, monkeypatch):
    """Networks that say the right shift, and besides turn the probe by half a milliradian."""
    data = campaign(odd, joints(120, 1), seed=1, turn_noise_mrad=0.1)
    plain = NetworkResidual.shift

    def shift_and_turn(self, q_rad):
        shift = plain(self, q_rad)
        shift[:, 3] += 5e-4
        return shift

    monkeypatch.setattr(NetworkResidual, "shift", shift_and_turn)
    learnt = learn(ur5, data, network=QUICK)
    assert learnt.calibration.residual is None
    assert learnt.network.startswith("left out: ")
    assert "orientations become worse" in learnt.network


def test_a_gain_that_unseen_poses_do_not_confirm_is_not_accepted(ur5, odd, monkeypatch):
    data = campaign(odd, joints(60, 1), seed=1)
    trial = KeptAway(data, Context.of(data), np.arange(60) % 5 == 0)
    monkeypatch.setattr(module, "cross_validated", lambda *_: Proof(1e-9, 0.1, 0.05))
    for gain in (Gain(0.1, 0.1, (-0.1, 0.1)), Gain(0.1, 0.11, (-0.1, 0.1)), Gain(0.1, float("nan"), (0.0, 0.0))):
        monkeypatch.setattr(trial, "gain", lambda *_, gain=gain: gain)
        decision = decide(trial, _fit(ur5, data), QUICK)
        assert decision.model is None
        assert decision.why.startswith("left out: on the poses kept away")


# Beyond the data


@pytest.mark.parametrize("seed", [0, 1, *map(also_slow, (2, 3))])
def test_beyond_the_data_networks_never_make_a_robot_worse_by_more_than_a_twentieth(ur5, seed, capsys):
    """One joint, or all of them, driven beyond what was measured; at 20 degrees networks say nothing any more."""
    odd = arm(seed)
    data = campaign(odd, joints(200, seed), seed=seed)
    model = with_network(calibrate(ur5, data), data, Context.of(data), QUICK).model
    plain, reach = replace(model, residual=None), model.residual.reach
    rng = np.random.default_rng(seed)
    for degrees in (1, 2, 3, 5, 10, 20):
        ratios = {}
        for driven in (1, 2, 6):
            q = joints(300, 100 + seed)
            for row in q:
                for joint in rng.choice(6, driven, replace=False):
                    limit = (reach.lower_rad, reach.upper_rad)[up := int(rng.integers(2))][joint]
                    row[joint] = limit + np.radians(degrees) * (2 * up - 1)
            truth = true_positions(odd, q)
            ratios[driven] = mean_error_mm(model, q, truth) / mean_error_mm(plain, q, truth)
        with capsys.disabled():
            told = ", ".join(f"{driven} joints {ratio:.3f}" for driven, ratio in ratios.items())
            print(f"\nseed {seed}, {degrees} degrees beyond: error with networks over error without: {told}")
        assert max(ratios.values()) <= (1.05 if degrees < 5 else 1.0 + 1e-12)
