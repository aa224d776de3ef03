"""From one generation to the next: mutation, crossover and selection as the paper's eq. 19 to 21 have them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from by_loop import error_by_loop, genes
from small_evolution import SMALL, population_of
from truepath.residual import succession
from truepath.residual.evolution import first_generation
from truepath.residual.network import with_ones
from truepath.residual.population import Population, generator_for
from truepath.residual.task import Task

CPU = torch.device("cpu")


@pytest.fixture(params=["_on_cpu", "_on_gpu"])
def successors(request):
    """The compiled kernel, and the tensors of a GPU, which may lie on a CPU too."""
    return getattr(succession, request.param)


@pytest.fixture
def trials(successors):
    """Trials are what follows if each of them is better than what is there."""

    def trials(population, best, settings, generator):
        error = torch.full((len(population),), torch.inf, dtype=torch.float64)
        error[best] = 1e300
        rng = np.random.default_rng(0)
        task = Task(with_ones(torch.tensor(rng.uniform(-1, 1, (5, 3)))), torch.tensor(rng.normal(size=(2, 5))))
        return successors(population, error, task, settings, generator)[0]

    return trials


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


def followed(successors, state, task, generation):
    return successors(state.population, state.error, task, SMALL, generator_for(0, generation, CPU))


def test_nobody_s_error_rises_and_only_the_better_trial_replaces_an_individual(successors, task):
    state = before = first_generation(Task.of(*task), SMALL, seed=0)
    for generation in range(1, 13):
        population, error = followed(successors, state, Task.of(*task), generation)
        assert (error <= state.error).all()
        for number in np.flatnonzero(error == state.error):
            for own, same in zip(
                genes(state.population, number).values(), genes(population, number).values(), strict=True
            ):
                np.testing.assert_array_equal(own, same)
        state = replace(state, population=population, error=error)
    assert state.best_error < 0.5 * before.best_error


def test_stated_errors_are_those_of_the_individuals(successors, task):
    state = first_generation(Task.of(*task), SMALL, seed=2)
    for generation in range(1, 13):
        population, error = followed(successors, state, Task.of(*task), generation)
        expected = [error_by_loop(population.network(k), *task) for k in range(len(population))]
        np.testing.assert_allclose(error.numpy(), expected, rtol=1e-4)
        state = replace(state, population=population, error=error)


def test_what_a_trial_misses_beyond_all_numbers_is_not_better(successors):
    """Two others are so far apart that their difference has no finite error in single precision."""
    population = population_of([3, 3, 3], dtype=torch.float32)
    population.bias[1], population.bias[2] = 3e38, -3e38
    task = Task(torch.zeros(4, 5), torch.zeros(2, 5))
    error = torch.tensor([0.5, torch.inf, torch.inf])
    after, found = successors(population, error, task, replace(SMALL, crossover=1.0), generator_for(0, 1, CPU))
    assert found[0] <= 0.5
    assert torch.isfinite(after.bias[0]).all()


def test_the_given_population_stays_as_it_is(successors, task):
    state = first_generation(Task.of(*task), SMALL, seed=3)
    before = [
        part.clone() for part in (state.population.genes, state.population.bias, state.population.sizes, state.error)
    ]
    followed(successors, state, Task.of(*task), 1)
    after = (state.population.genes, state.population.bias, state.population.sizes, state.error)
    assert all(torch.equal(own, same) for own, same in zip(before, after, strict=True))
