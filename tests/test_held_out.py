"""Whether columns predict readings that were left out: chance must look like chance, and a cause like a cause."""

import numpy as np
import pytest
from scipy import stats
from truepath.effect_fit import fit_effects
from truepath.effects import EFFECTS
from truepath.held_out import CrossValidation

POSES, KINEMATIC, OWN = 200, 6, 4
NO_REPEATS = np.arange(POSES)


def validation(rng, own=0.0, drift=0.0, poses=POSES):
    """Readings of unit noise; ``own`` is the size of the effect's coefficients, ``drift`` of what neighbours share."""
    A = rng.normal(size=(poses, 3, KINEMATIC + OWN))
    x = np.concatenate([rng.normal(size=KINEMATIC), np.full(OWN, own)])
    y = A @ x + rng.normal(size=(poses, 3)) + drift * np.sin(6.0 * np.linspace(0, np.pi, poses))[:, None]
    place = np.repeat([-1, 0], [KINEMATIC, OWN])
    return CrossValidation(y, A, np.full(KINEMATIC + OWN, 1e-4), place)


def p_value(problem, visits=None):
    visits = np.arange(len(problem.y)) if visits is None else visits
    return problem.p_values({"own": problem.place == 0}, visits)["own"]


@pytest.fixture(scope="module")
def by_chance():
    """400 p values of an effect that is not there."""
    rng = np.random.default_rng(0)
    return np.array([p_value(validation(rng)) for _ in range(400)])


@pytest.mark.parametrize("level", [0.01, 0.05, 0.2])
def test_an_effect_that_is_not_there_passes_no_more_often_than_its_p_value_says(by_chance, level):
    allowed = stats.binom.ppf(0.999, len(by_chance), level)
    assert np.sum(by_chance <= level) <= allowed


def test_chance_is_as_often_lucky_as_unlucky(by_chance):
    """The larger of two p values that go along with each other: between uniform and the larger of two uniform ones."""
    assert 0.45 < np.median(by_chance) < 0.75
    assert by_chance.max() > 0.95


def test_an_effect_that_is_there_predicts_what_was_left_out():
    rng = np.random.default_rng(1)
    found = [p_value(validation(rng, own=0.3)) for _ in range(20)]
    assert max(found) < 1e-4


def test_the_stronger_the_effect_the_smaller_the_p_value():
    found = [p_value(validation(np.random.default_rng(2), own=size)) for size in (0.05, 0.1, 0.2, 0.4)]
    assert found == sorted(found, reverse=True)


def test_an_effect_is_judged_given_the_others_and_not_for_their_merits():
    """Two effects, only the first of which is there: each has to predict what the other leaves."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(POSES, 3, 8))
    y = A[:, :, 2:5] @ np.full(3, 0.4) + rng.normal(size=(POSES, 3))
    place = np.array([-1, -1, 0, 0, 0, 1, 1, 1])
    problem = CrossValidation(y, A, np.full(8, 1e-4), place)
    p = problem.p_values({"real": place == 0, "idle": place == 1}, NO_REPEATS)
    assert p["real"] < 1e-6
    assert p["idle"] > 1e-3


def test_noise_that_lasts_does_not_make_a_slow_drift_of_many_parameters_look_predictable():
    """Each row is measured twice over with the same error: left out one by one, its twin would give it away."""
    rng = np.random.default_rng(4)
    passed = 0
    for _ in range(30):
        base = validation(rng, poses=POSES // 2)
        y, A = np.repeat(base.y, 2, axis=0), np.repeat(base.A, 2, axis=0)
        A = np.concatenate([A[:, :, :KINEMATIC], _hats(POSES, 60)], axis=2)
        place = np.repeat([-1, 0], [KINEMATIC, A.shape[2] - KINEMATIC])
        twins = CrossValidation(y, A, np.full(len(place), 1e-2), place)
        passed += p_value(twins, np.repeat(np.arange(POSES // 2), 2)) < 0.01
    assert passed <= 3


def _hats(poses, count):
    """``(poses, 3, 3 count)`` columns that each hold for a few rows in a row."""
    hats = np.maximum(1.0 - np.abs(np.linspace(0, count, poses)[:, None] - np.arange(count)), 0.0)
    return np.concatenate([hats[:, None] * np.eye(3)[k][:, None] for k in range(3)], axis=2)


def test_visits_of_one_pose_are_left_out_together():
    """Every pose has an error of its own, the same at every visit, and the effect a column for every pose."""
    rng = np.random.default_rng(5)
    visits = rng.permutation(np.tile(np.arange(25), 8))
    own_error = rng.normal(scale=5.0, size=(25, 3))
    y = own_error[visits] + rng.normal(size=(POSES, 3))
    poses = np.eye(25)[visits]
    A = np.concatenate([poses[:, None] * np.eye(3)[k][:, None] for k in range(3)], axis=2)
    problem = CrossValidation(y, A, np.full(75, 1e-2), np.zeros(75, int))
    own = np.ones(75, bool)
    assert problem.p_values({"pose": own}, visits)["pose"] > 0.01
    assert problem.p_values({"pose": own}, NO_REPEATS)["pose"] < 1e-6


def test_a_fit_of_a_robot_without_any_cause_predicts_nothing_by_its_effects(real_ur5, clean, clean_kinematic):
    """All of encoder_scale forced into the model of a robot that has none of it."""
    context = clean_kinematic.context
    terms = EFFECTS["encoder_scale"].terms(real_ur5.robot, context)
    fit = fit_effects(clean_kinematic.fit, context, terms, prune=False)
    problem = CrossValidation.of(clean_kinematic.fit, context, fit)
    groups = {str(joint): problem.place == joint for joint in range(6)}
    assert problem.A.shape[2] - np.sum(problem.place >= 0) == clean_kinematic.fit.free.sum()
    p = problem.p_values(groups, clean.groups()[fit.inlier])
    assert min(p.values()) > 1e-3
