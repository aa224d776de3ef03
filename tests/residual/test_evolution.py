"""Differential evolution from its first generation on: hidden sizes step by the paper's eq. 22."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from by_loop import error_by_loop, output_by_loop
from hypothesis import given
from hypothesis import strategies as st
from small_evolution import SMALL, population_of
from truepath.residual.evolution import evolve, first_generation, next_generation, stepped
from truepath.residual.population import generator_for
from truepath.residual.task import Task

CPU = torch.device("cpu")


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


def test_sizes_step_every_so_many_generations_while_the_target_is_not_met(task):
    for target, steps in ((0.0, True), (1e9, False)):
        settings, never = (replace(SMALL, sizes_every=every, target=target) for every in (3, 1000))
        state = first_generation(Task.of(*task), settings, seed=1)
        for generation in range(1, 7):
            before = state
            state = next_generation(state, Task.of(*task), settings, seed=1)
            selected = next_generation(before, Task.of(*task), never, seed=1).population.sizes
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


def test_the_state_names_its_best_individual(task):
    state = evolve(*task, SMALL, 2)
    errors = [error_by_loop(state.population.network(k), *task) for k in range(len(state.population))]
    assert state.best == int(np.argmin(errors))
    assert state.best_error == state.error.min()
    assert error_by_loop(state.network, *task) == pytest.approx(min(errors), rel=1e-4)
