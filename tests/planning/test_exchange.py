"""Choosing among candidates: against every possible choice where there are few, and the textbook's formulas."""

from itertools import combinations

import numpy as np
import pytest
from truepath.planning.exchange import Criterion, exchange, greedy, information

RNG = np.random.default_rng(1)
BLOCKS = RNG.normal(size=(12, 2, 4)) * np.array([3.0, 1.0, 1.0, 0.3])
WANTED = np.diag([1.0, 2.0, 0.5, 4.0])
H = 0.1 * np.eye(4)
MEAN_VARIANCE, VOLUME = Criterion(WANTED), Criterion()


def after(rows):
    """Covariance once these candidates are measured, the textbook way."""
    X = BLOCKS[list(rows)].reshape(-1, 4)
    return np.linalg.inv(H + X.T @ X)


def left(criterion, rows):
    return np.trace(after(rows) @ WANTED) if criterion is MEAN_VARIANCE else np.linalg.slogdet(after(rows))[1]


@pytest.mark.parametrize("criterion", [MEAN_VARIANCE, VOLUME])
def test_the_gain_of_a_candidate_is_what_its_measurement_takes_away(criterion):
    so_far = H + information(BLOCKS[[0, 5]])
    gains = criterion.gains(so_far, BLOCKS)
    for k in range(12):
        assert gains[k] == pytest.approx(left(criterion, [0, 5]) - left(criterion, [0, 5, k]))


@pytest.mark.parametrize("criterion", [MEAN_VARIANCE, VOLUME])
def test_an_exchange_finds_nearly_the_best_of_all_choices_and_never_a_worse_one_than_it_starts_with(criterion):
    every = sorted(left(criterion, rows) for rows in combinations(range(12), 4))
    start = [0, 1, 2, 3]
    found = exchange(criterion, H, BLOCKS, start)
    assert left(criterion, found) <= left(criterion, start)
    assert left(criterion, found) <= every[5]  # of 495
    assert len(set(found)) == 4


@pytest.mark.parametrize("criterion", [MEAN_VARIANCE, VOLUME])
def test_no_single_exchange_makes_the_result_better(criterion):
    found = exchange(criterion, H, BLOCKS, greedy(criterion, H, BLOCKS, 5))
    best = left(criterion, found)
    for place in range(5):
        for new in set(range(12)) - set(found):
            other = [*found[:place], new, *found[place + 1 :]]
            assert left(criterion, other) >= best - 1e-4 * max(abs(best), 1.0)


def test_the_first_pick_is_the_single_best_and_each_later_one_the_best_given_those_before():
    picked = greedy(VOLUME, H, BLOCKS, 4)
    for k in range(4):
        others = [left(VOLUME, [*picked[:k], new]) for new in set(range(12)) - set(picked[:k])]
        assert left(VOLUME, picked[: k + 1]) == pytest.approx(min(others))


@pytest.mark.parametrize("criterion", [MEAN_VARIANCE, VOLUME])
def test_no_gain_exceeds_what_it_is_said_to_be_at_most(criterion):
    for so_far in (H, H + information(BLOCKS[:6])):
        assert (criterion.gains(so_far, BLOCKS) <= criterion.most(so_far, BLOCKS) + 1e-12).all()


@pytest.mark.parametrize("criterion", [MEAN_VARIANCE, VOLUME])
def test_what_turns_out_to_be_unusable_is_left_out_as_if_it_had_not_been_offered(criterion):
    usable = [k for k in range(12) if k % 3]
    without = BLOCKS[usable]
    expected = greedy(criterion, H, without, 4)
    found = greedy(criterion, H, BLOCKS, 4, lambda k: k in usable)
    assert found == [usable[k] for k in expected]
    assert len(greedy(criterion, H, BLOCKS, 12, lambda k: k in usable)) == len(usable)
    start = [1, 2, 4, 5]
    expected = exchange(criterion, H, without, [usable.index(k) for k in start])
    assert exchange(criterion, H, BLOCKS, start, lambda k: k in usable) == [usable[k] for k in expected]


def test_nothing_is_picked_twice_and_no_more_than_there_are():
    assert sorted(greedy(VOLUME, H, BLOCKS, 50)) == list(range(12))


def test_units_of_the_parameters_do_not_change_the_choice():
    unit = np.array([1.0, 1e-3, 1.0, 50.0])
    for criterion in (MEAN_VARIANCE, VOLUME):
        wanted = None if criterion.wanted is None else WANTED * np.outer(unit, unit)
        other = greedy(Criterion(wanted), H * np.outer(unit, unit), BLOCKS * unit, 5)
        assert other == greedy(criterion, H, BLOCKS, 5)


def test_the_best_places_for_a_straight_line_are_its_ends():
    """The D-optimal design of a straight line halves the visits between both ends (Kiefer, Wolfowitz 1959)."""
    x = np.linspace(-1, 1, 41)
    blocks = np.stack([np.ones(41), x], axis=1)[:, None]
    blocks = np.concatenate([blocks] * 5)  # so that a place can be visited more than once
    found = exchange(VOLUME, 1e-9 * np.eye(2), blocks, list(range(80, 90)))
    assert sorted(x[k % 41] for k in found) == [-1.0] * 5 + [1.0] * 5
