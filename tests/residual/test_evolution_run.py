"""An evolution ends when it should, says the same for the same seed, and can be interrupted at any time."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from by_loop import genes
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from small_evolution import SMALL
from truepath.errors import InputError
from truepath.residual import evaluation
from truepath.residual.evolution import State, evolve, has_ended
from truepath.residual.limits import Settings


def same(a, b):
    """Whether two states are the same to the last bit."""
    pairs = [(a.error, b.error), (a.population.sizes, b.population.sizes)]
    for number in range(len(a.population)):
        one, other = genes(a.population, number), genes(b.population, number)
        if not all(np.array_equal(one[name], other[name]) for name in one):
            return False
    counters = (a.generation, a.stale, a.reference) == (b.generation, b.stale, b.reference)
    return counters and all(torch.equal(*pair) for pair in pairs)


# The end


def test_it_ends_when_the_target_is_met(task):
    state = evolve(*task, replace(SMALL, target=0.4, generations=1000, stagnation=1000), 0)
    assert state.best_error <= 0.4
    assert state.generation < 1000


def test_it_ends_after_the_last_generation(task):
    seen = []
    state = evolve(*task, SMALL, 0, observe=lambda state: seen.append(state.generation))
    assert state.generation == SMALL.generations
    assert seen == list(range(1, SMALL.generations + 1))


def test_it_ends_when_the_error_has_not_fallen_for_so_many_generations():
    """Nothing is learnt where there is nothing but a zero that the first population cannot come closer to for long."""
    x = np.zeros((3, 1))
    errors = []
    settings = replace(SMALL, generations=5000, stagnation=7, individuals=3, largest=2)
    state = evolve(x, np.full((3, 1), 100.0), settings, 0, observe=lambda state: errors.append(state.best_error))
    assert state.generation < 5000
    assert state.stale == 7
    reference = state.reference
    assert all(error > (1 - 1e-3) * reference for error in errors[-7:])


def test_what_has_ended_is_left_as_it_is(task):
    state = evolve(*task, SMALL, 0)
    assert has_ended(state, SMALL)
    assert evolve(*task, SMALL, 0, start=state) is state


# Chance


def test_the_same_seed_gives_the_same_bits_another_seed_others(task):
    one, again, other = (evolve(*task, SMALL, seed) for seed in (5, 5, 6))
    assert same(one, again)
    assert not same(one, other)


def test_it_is_the_same_to_the_last_bit_on_any_number_of_threads(task, monkeypatch):
    monkeypatch.setattr(evaluation, "AT_ONCE", 1)  # so that there is something to share out
    one, three = (evolve(*task, SMALL, 5, threads=threads) for threads in (1, 3))
    assert same(one, three)


@hypothesis_settings(max_examples=8)
@given(moment=st.integers(1, SMALL.generations - 1), seed=st.integers(0, 3))
def test_interrupted_at_any_generation_it_goes_on_as_if_nothing_had_happened(task, moment, seed):
    states = []
    whole = evolve(*task, SMALL, seed, observe=states.append)
    resumed = evolve(*task, SMALL, seed, start=states[moment - 1])
    assert states[moment - 1].generation == moment
    assert same(whole, resumed)


def test_numbers_are_in_single_precision(task):
    state = evolve(*task, replace(SMALL, generations=1), 0)
    assert isinstance(state, State)
    for tensor in (state.error, state.population.hidden, state.population.output, state.population.bias):
        assert tensor.dtype == torch.float32


# Settings


@pytest.mark.parametrize(
    "wrong",
    [
        {"individuals": 2},
        {"smallest": 0},
        {"smallest": 9, "largest": 8},
        {"generations": 0},
        {"stagnation": 0},
        {"sizes_every": 0},
    ],
    ids=str,
)
def test_settings_that_make_no_evolution_are_refused(wrong):
    with pytest.raises(InputError):
        Settings(**wrong)


def test_the_paper_s_factor_and_crossover_are_the_defaults():
    assert (Settings().factor, Settings().crossover) == (0.5, 0.9)
