"""Differential evolution as the paper's eq. 18 to 22 have it: mutation, crossover, selection, steps of the size."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from by_loop import error_by_loop, genes, output_by_loop, random_network
from hypothesis import given
from hypothesis import strategies as st
from small_evolution import SMALL
from truepath.residual import evolution
from truepath.residual.evolution import evolve, first_generation, next_generation, stepped
from truepath.residual.network import with_ones
from truepath.residual.population import Population, generator_for

CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def tensors(task):
    """The same as an evolution wants them."""
    x, target = task
    return with_ones(torch.tensor(x, dtype=torch.float32)), torch.tensor(target.T.copy(), dtype=torch.float32)


def population_of(sizes, seed=0, room=9):
    rng = np.random.default_rng(seed)
    return Population.of([random_network(rng, 3, size, 2) for size in sizes], room, CPU, torch.float64)


@pytest.fixture(params=["_trials_on_cpu", "_trials_on_gpu"])
def trials(request):
    """The compiled trials, and those of a GPU, whose tensors may lie on a CPU too."""
    return getattr(evolution, request.param)


# Mutation


def test_a_mutant_is_the_best_with_half_the_difference_of_two_others(trials):
    """Eq. 19; without crossover a trial is the mutant itself."""
    population, best = population_of([4] * 6), 2
    trial = trials(population, best, replace(SMALL, crossover=1.0), generator_for(0, 1, CPU))
    flat = [np.concatenate([part.ravel() for part in genes(population, k).values()]) for k in range(6)]
    candidates = {(a, b): flat[best] + 0.5 * (flat[a] - flat[b]) for a in range(6) for b in range(6) if a != b}
    for number in range(6):
        found = np.concatenate([part.ravel() for part in genes(trial, number).values()])
        assert min(np.abs(found - expected).max() for expected in candidates.values()) < 1e-12


def test_two_different_others_are_drawn_and_all_pairs_are(trials):
    population = population_of([3] * 4, seed=1)
    flat = [np.concatenate([part.ravel() for part in genes(population, k).values()]) for k in range(4)]
    drawn = set()
    for generation in range(30):
        trial = trials(population, 0, replace(SMALL, crossover=1.0), generator_for(0, generation, CPU))
        for number in range(4):
            found = np.concatenate([part.ravel() for part in genes(trial, number).values()])
            drawn |= {
                (a, b)
                for a in range(4)
                for b in range(4)
                if np.abs(found - flat[0] - 0.5 * (flat[a] - flat[b])).max() < 1e-12 and a != b
            }
            assert np.abs(found - flat[0]).max() > 1e-6
    assert len(drawn) == 12


def test_trials_have_the_size_of_the_best_whatever_the_others_have(trials):
    population = population_of([1, 9, 4, 6, 2, 9])
    for best, size in ((0, 1), (1, 9), (2, 4)):
        trial = trials(population, best, SMALL, generator_for(0, 1, CPU))
        assert trial.sizes.tolist() == [size] * 6
        assert (trial.output[:, :, size:] == 0).all()


def test_what_others_have_beyond_the_length_of_the_best_is_disregarded(trials):
    population, settings = population_of([3, 9, 9, 9]), replace(SMALL, crossover=1.0)
    more = population.genes.clone()
    more[1:, 3:, :4] = 1e6
    more[1:, 3:, 4:] = -1e6
    changed = replace(population, genes=more)
    plain, other = (trials(each, 0, settings, generator_for(0, 1, CPU)) for each in (population, changed))
    for number in range(4):
        for a, b in zip(genes(plain, number).values(), genes(other, number).values(), strict=True):
            np.testing.assert_array_equal(a, b)


def test_what_others_lack_of_the_length_of_the_best_is_drawn_from_minus_1_to_1(trials):
    """Against a best of zeros the mutant's neurons beyond all others are half the difference of two random numbers."""
    population = population_of([8, 2, 2, 2, 2, 2, 2, 2])
    zero = [torch.zeros_like(part) for part in (population.genes, population.bias)]
    population = Population(*zero, population.sizes)
    found = []
    for generation in range(200):
        trial = trials(population, 0, replace(SMALL, crossover=1.0), generator_for(0, generation, CPU))
        found += [trial.hidden[:, 2:8].numpy().ravel(), trial.output[:, :, 2:8].numpy().ravel()]
        assert (trial.hidden[:, :2] == 0).all()
    found = np.concatenate(found)
    both_random = found[np.abs(found) > 0]
    assert np.abs(found).max() <= 1.0
    assert np.abs(found).max() > 0.95
    # half the difference of two numbers of variance 1/3; where the best itself is drawn, a quarter of 1/3
    others = 6 / 8  # pairs of which the best (which has all numbers, zeros) is none
    assert both_random.var() == pytest.approx(others / 6 + (1 - others) / 12, rel=0.05)


# Crossover


def test_nine_numbers_in_ten_are_mutated_the_others_are_the_individual_s_own(trials):
    population = population_of([6] * 12, seed=4)
    own, all_of_them = 0, 0
    for generation in range(100):
        trial = trials(population, 3, SMALL, generator_for(1, generation, CPU))
        for number in set(range(12)) - {3}:
            for ours, theirs in zip(genes(population, number).values(), genes(trial, number).values(), strict=True):
                own += int((ours == theirs).sum())
                all_of_them += ours.size
    assert own / all_of_them == pytest.approx(0.1, abs=0.01)


def test_single_numbers_are_crossed_not_whole_neurons(trials):
    population = population_of([6] * 12, seed=4)
    trial = trials(population, 3, replace(SMALL, crossover=0.5), generator_for(1, 1, CPU))
    kept = (trial.hidden == population.hidden)[:, :6]
    of_neuron = kept.sum(dim=2)
    assert ((of_neuron > 0) & (of_neuron < 4)).any()


def test_an_individual_keeps_only_numbers_that_it_has(trials):
    """It has two neurons of the best's six: with no mutation at all these are its own, the other four the mutant's."""
    population = population_of([6, 2, 2, 2])
    trial = trials(population, 0, replace(SMALL, crossover=0.0, factor=0.0), generator_for(0, 1, CPU))
    for number in (1, 2, 3):
        own, best, found = genes(population, number), genes(population, 0), genes(trial, number)
        np.testing.assert_array_equal(found["hidden"], np.r_[own["hidden"], best["hidden"][2:]])
        np.testing.assert_array_equal(found["output"], np.c_[own["output"], best["output"][:, 2:]])
        np.testing.assert_array_equal(found["bias"], own["bias"])


# Selection


def test_nobody_s_error_rises_and_only_the_better_trial_replaces_an_individual(tensors):
    settings = replace(SMALL, sizes_every=1000)
    state = first_generation(*tensors, settings, seed=0)
    for _ in range(12):
        following = next_generation(state, *tensors, settings, seed=0)
        assert (following.error <= state.error).all()
        for number in np.flatnonzero(following.error == state.error):
            for before, after in zip(
                genes(state.population, number).values(), genes(following.population, number).values(), strict=True
            ):
                np.testing.assert_array_equal(before, after)
        state = following
    assert state.best_error < 0.5 * float(first_generation(*tensors, settings, seed=0).error.min())


def test_stated_errors_are_those_of_the_individuals_in_every_generation(task, tensors):
    state = first_generation(*tensors, SMALL, seed=2)
    for _ in range(12):
        state = next_generation(state, *tensors, SMALL, seed=2)
        expected = [error_by_loop(state.population.network(k), *task) for k in range(len(state.population))]
        np.testing.assert_allclose(state.error.numpy(), expected, rtol=1e-4)
    assert state.best_error == state.error.min()
    assert error_by_loop(state.network, *task) == pytest.approx(min(expected), rel=1e-4)


# Hidden sizes


@given(sizes=st.lists(st.integers(2, 9), min_size=3, max_size=15), best=st.integers(0, 14), seed=st.integers(0, 100))
def test_sizes_step_as_equation_22_says_within_the_limits(sizes, best, seed):
    best %= len(sizes)
    population, lost = stepped(population_of(sizes, seed), best, SMALL, generator_for(seed, 1, CPU))
    by_hand = [size - 1 if sizes[best] < size else size + 1 for size in sizes]
    assert population.sizes.tolist() == [min(max(size, 2), 9) for size in by_hand]
    assert lost.tolist() == [after < before for before, after in zip(sizes, population.sizes.tolist(), strict=True)]


def test_growing_changes_no_output_and_shrinking_drops_the_last_neuron(task):
    before = population_of([3, 5, 9, 8, 5])
    after, _ = stepped(before, 1, SMALL, generator_for(0, 1, CPU))
    x = task[0]
    for number, grown in enumerate((True, True, False, False, True)):
        old, new = before.network(number), after.network(number)
        if grown:
            assert new.neurons == old.neurons + 1
            np.testing.assert_allclose(output_by_loop(new, x), output_by_loop(old, x), atol=1e-14)
            assert np.abs(new.hidden[-1]).min() > 0
            assert np.abs(new.hidden[-1]).max() <= 1
        else:
            for a, b in ((new.hidden, old.hidden[:-1]), (new.output, old.output[:, :-1]), (new.bias, old.bias)):
                np.testing.assert_array_equal(a, b)


def test_sizes_step_every_so_many_generations_while_the_target_is_not_met(tensors):
    for target, steps in ((0.0, True), (1e9, False)):
        settings = replace(SMALL, sizes_every=3, target=target)
        state = first_generation(*tensors, settings, seed=1)
        for generation in range(1, 7):
            before = state
            state = next_generation(state, *tensors, settings, seed=1)
            selected = next_generation(before, *tensors, replace(settings, sizes_every=1000), seed=1).population.sizes
            assert torch.equal(state.population.sizes, selected) == (not steps or generation % 3 != 0)


def test_the_best_error_never_rises_even_when_sizes_step(task):
    errors = []
    evolve(
        *task, replace(SMALL, sizes_every=1, generations=40), 3, observe=lambda state: errors.append(state.best_error)
    )
    assert len(errors) == 40
    assert (np.diff(errors) <= 0).all()


def test_sizes_drift_to_where_they_help_within_the_limits(task):
    sizes = []
    evolve(*task, SMALL, 0, observe=lambda state: sizes.append(state.population.sizes.tolist()))
    assert min(map(min, sizes)) >= 2
    assert max(map(max, sizes)) <= 9
