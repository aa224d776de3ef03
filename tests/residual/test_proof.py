"""A network is worth having if it lowers the error on poses that it did not learn from, at random and in blocks."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from odd_robot import QUICK, arm, campaign, joints
from scipy import stats
from truepath.calibrate import calibrate
from truepath.context import Context
from truepath.kept_away import KeptAway
from truepath.residual import proof as module
from truepath.residual.ensemble import NetworkResidual
from truepath.residual.proof import Proof, compare, cross_validated
from truepath.residual.samples import Samples

SILENT = SimpleNamespace(shift=lambda q_rad: np.zeros((len(q_rad), 6)))


def samples(position_mm, orientation_mrad=None, visits=None):
    """Poses that are missed by so much, in random directions."""
    rng, count = np.random.default_rng(0), len(position_mm)
    way = rng.normal(size=(count, 3))
    miss = 1e-3 * np.asarray(position_mm)[:, None] * way / np.linalg.norm(way, axis=1)[:, None]
    if orientation_mrad is not None:
        way = rng.normal(size=(count, 3))
        turn = 1e-3 * np.asarray(orientation_mrad)[:, None] * way / np.linalg.norm(way, axis=1)[:, None]
        miss = np.c_[miss, turn]
    return Samples(np.zeros((count, 6)), miss, np.arange(count) if visits is None else visits)


@pytest.fixture
def errors():
    """Before and after, the latter lower by less than they scatter."""
    rng = np.random.default_rng(1)
    before = 0.1 + 0.03 * rng.random(80)
    return before, before - 0.002 - 0.004 * rng.normal(size=80)


# Comparing


def test_the_p_value_is_that_of_a_one_sided_paired_test(errors):
    before, after = errors
    proof = compare(samples(before), samples(after))
    assert proof.p_value == pytest.approx(stats.ttest_rel(before, after, alternative="greater").pvalue)
    assert (proof.before_mm, proof.after_mm) == pytest.approx((before.mean(), after.mean()))
    assert proof.holds


def test_what_is_worse_is_not_proved(errors):
    before, after = errors
    proof = compare(samples(after), samples(before))
    assert proof.p_value > 0.99
    assert not proof.holds


def test_visits_of_a_pose_count_once(errors):
    before, after = errors
    once = compare(samples(before), samples(after))
    often = compare(*(samples(np.repeat(each, 9), visits=np.repeat(np.arange(80), 9)) for each in (before, after)))
    assert often.p_value == pytest.approx(once.p_value)


def test_nothing_changed_is_nothing_gained(errors):
    proof = compare(samples(errors[0]), samples(errors[0]))
    assert proof == Proof(1.0, proof.before_mm, proof.before_mm)
    assert not proof.holds


def test_a_gain_by_chance_is_seldom_taken_for_one():
    """At a level of one in a hundred: 400 pairs of equally good models."""
    rng, held = np.random.default_rng(2), 0
    for _ in range(400):
        before, after = 0.1 + 0.03 * rng.normal(size=(2, 60))
        held += compare(samples(np.abs(before)), samples(np.abs(after))).holds
    assert held <= 12


def test_orientations_that_become_worse_undo_a_gain_of_position(errors):
    before, after = errors
    better, worse = np.full(80, 0.2), np.full(80, 0.21)
    assert compare(samples(before, worse), samples(after, better)).holds
    proof = compare(samples(before, better), samples(after, worse))
    assert not proof.holds
    assert proof.turns_away


def test_orientations_that_are_as_good_as_before_but_for_chance_are_no_objection(errors):
    before, after = errors
    same, nearly = np.full(80, 0.2), np.full(80, 0.202)
    assert compare(samples(before, same), samples(after, nearly)).holds


def test_errors_that_are_no_numbers_prove_nothing(errors):
    proof = compare(samples(errors[0]), samples(np.full(80, np.nan)))
    assert not proof.holds


# Cross-validation


@pytest.fixture(scope="module")
def odd():
    """A robot with an error that no cause explains, 200 poses of it, the last forty kept away."""
    data = campaign(arm(1), joints(200, 1), seed=1)
    return KeptAway(data, Context.of(data), np.arange(200) >= 160)


@pytest.fixture(scope="module")
def fit(ur5, odd):
    """Function: the kinematics fitted to some rows of it."""
    return lambda rows, drifting: calibrate(ur5, odd.measurements.subset(rows)).model


def test_every_fit_and_every_network_is_asked_about_poses_that_it_has_not_seen(odd, fit, monkeypatch):
    fitted_to, learnt_from, asked = [], [], []
    learn, poses = module.learn_for_each, [row.tobytes() for row in odd.measurements.q_rad]

    def fit_and_remember(rows, drifting):
        fitted_to.append({poses[row] for row in rows})
        return fit(rows, drifting)

    def learn_and_remember(parts, *rest):
        learnt_from.extend({row.tobytes() for row in part.q_rad} for part in parts)
        return learn(parts, *rest)

    def say_nothing_and_remember(_, q_rad):
        asked.append({row.tobytes() for row in q_rad})
        return np.zeros((len(q_rad), 6))

    monkeypatch.setattr(module, "learn_for_each", learn_and_remember)
    monkeypatch.setattr(NetworkResidual, "shift", say_nothing_and_remember)
    assert cross_validated(odd, fit_and_remember, QUICK).p_value == 1.0
    seen = {poses[row] for row in np.flatnonzero(odd.seen)}
    assert len(fitted_to) == 10
    assert fitted_to == learnt_from
    assert asked == [seen - rows for rows in fitted_to]
    assert set.union(*asked[:5]) == set.union(*asked[5:]) == seen


def test_the_worse_of_both_ways_counts(odd, fit, monkeypatch):
    for first, second in ((1e-9, 0.3), (0.3, 1e-9)):
        given = iter([Proof(first, 0.1, 0.05), Proof(second, 0.1, 0.06)])
        with monkeypatch.context() as patch:
            patch.setattr(module, "compare", lambda *_, given=given: next(given))
            patch.setattr(module, "learn_for_each", lambda parts, *_: [SILENT] * len(parts))
            assert cross_validated(odd, fit, QUICK).p_value == 0.3


def test_what_goes_with_the_pose_is_proved(odd, fit):
    proof = cross_validated(odd, fit, QUICK)
    assert proof.p_value < 1e-6
    assert proof.after_mm < 0.8 * proof.before_mm


def test_of_too_few_poses_nothing_is_proved_and_nothing_is_fitted(odd):
    for count, repeats in ((29, 1), (29, 4)):
        rows = np.tile(np.arange(count), repeats)
        data = replace(odd.measurements.subset(rows), pose_id=rows)
        few = KeptAway(data, Context.of(data), np.zeros(count * repeats, bool))
        assert cross_validated(few, pytest.fail, QUICK) == Proof(1.0, 0.0, 0.0)
