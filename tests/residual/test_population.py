"""A whole generation is evaluated at once, and each individual gets the error that it would have alone (eq. 15)."""

import numpy as np
import pytest
import torch
from by_loop import error_by_loop, random_network
from hypothesis import given
from hypothesis import strategies as st
from truepath.residual import population as module
from truepath.residual.network import with_ones
from truepath.residual.population import Population, generator_for

CPU = torch.device("cpu")
INPUTS, OUTPUTS = 3, 2


def drawn(sizes, seed, samples=6):
    """Networks of these sizes, inputs ``(N, 3)`` and targets ``(N, 2)``."""
    rng = np.random.default_rng(seed)
    networks = [random_network(rng, INPUTS, size, OUTPUTS, size=2.0) for size in sizes]
    return networks, rng.uniform(-1, 1, (samples, INPUTS)), rng.normal(size=(samples, OUTPUTS))


def errors(networks, x, target, room, dtype=torch.float64):
    """``(P,)`` as the population says."""
    population = Population.of(networks, room, CPU, dtype)
    x1 = with_ones(torch.tensor(x, dtype=dtype))
    return population.mean_squared_error(x1, torch.tensor(target.T.copy(), dtype=dtype)).numpy()


SIZES = {
    "one individual": [4],
    "all equal": [5] * 6,
    "growing": [1, 2, 3, 7, 9],
    "in disorder": [7, 1, 9, 9, 2, 5, 1],
    "largest first": [9, 1],
}


@pytest.mark.parametrize("kind", SIZES)
def test_errors_are_those_of_each_network_alone(kind):
    networks, x, target = drawn(SIZES[kind], seed=3)
    expected = [error_by_loop(network, x, target) for network in networks]
    np.testing.assert_allclose(errors(networks, x, target, room=9), expected, rtol=1e-12)


@pytest.mark.parametrize("fast", [1, 500, 1 << 30], ids=["one at a time", "some at a time", "all at once"])
@pytest.mark.parametrize("kind", SIZES)
def test_what_a_gpu_would_compute_is_the_same(monkeypatch, kind, fast):
    """The tensors may lie on a CPU too."""
    monkeypatch.setattr(module, "GPU_BYTES", fast)
    networks, x, target = drawn(SIZES[kind], seed=3)
    population = Population.of(networks, 9, CPU, torch.float64)
    squares = population._squares_on_gpu(with_ones(torch.tensor(x)), torch.tensor(target.T.copy()))
    expected = [len(x) * error_by_loop(network, x, target) for network in networks]
    np.testing.assert_allclose(squares.numpy(), expected, rtol=1e-12)


def test_errors_are_the_same_to_the_last_bit_on_any_number_of_threads():
    networks, x, target = drawn([3, 8, 20, 40] * 10, seed=5, samples=100)
    population = Population.of(networks, 40, CPU, torch.float32)
    x1, wanted = with_ones(torch.tensor(x, dtype=torch.float32)), torch.tensor(target.T.copy(), dtype=torch.float32)
    alone = population.mean_squared_error(x1, wanted)
    for threads in (2, 3, 8):
        assert torch.equal(population.mean_squared_error(x1, wanted, threads), alone)


@given(sizes=st.lists(st.integers(1, 12), min_size=1, max_size=12), seed=st.integers(0, 999), room=st.integers(12, 20))
def test_room_for_more_neurons_changes_nothing(sizes, seed, room):
    networks, x, target = drawn(sizes, seed)
    expected = [error_by_loop(network, x, target) for network in networks]
    np.testing.assert_allclose(errors(networks, x, target, room), expected, rtol=1e-11)


def test_in_single_precision_errors_are_right_to_a_hundred_thousandth():
    networks, x, target = drawn([3, 8, 20, 40] * 10, seed=5, samples=40)
    expected = [error_by_loop(network, x, target) for network in networks]
    found = errors(networks, x, target, 40, torch.float32)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_an_individual_comes_out_as_it_went_in():
    networks, *_ = drawn([4, 1, 6], seed=1)
    population = Population.of(networks, 10, CPU, torch.float64)
    assert len(population) == 3
    assert population.sizes.tolist() == [4, 1, 6]
    for number, network in enumerate(networks):
        found = population.network(number)
        for name in ("hidden", "output", "bias"):
            np.testing.assert_array_equal(getattr(found, name), getattr(network, name))


def test_of_two_populations_each_individual_is_taken_from_the_one_that_is_chosen():
    ours, theirs = (drawn([2, 5, 3], seed)[0] for seed in (1, 2))
    chosen = torch.tensor([True, False, True])
    theirs = [theirs[1], theirs[0], theirs[2]]  # sizes 5, 2, 3
    mixed = Population.of(ours, 6, CPU, torch.float64).where(chosen, Population.of(theirs, 6, CPU, torch.float64))
    assert mixed.sizes.tolist() == [5, 5, 3]
    for number, network in enumerate((theirs[0], ours[1], theirs[2])):
        np.testing.assert_array_equal(mixed.network(number).hidden, network.hidden)
        np.testing.assert_array_equal(mixed.network(number).output, network.output)


def test_random_networks_have_weights_drawn_evenly_from_minus_1_to_1_and_nothing_in_the_padding():
    sizes = torch.full((200,), 8)
    population = Population.random(sizes, 12, 6, 3, generator_for(0, 0, CPU), torch.float64)
    for values in (population.hidden[:, :8], population.output[:, :, :8], population.bias):
        assert -1 <= values.min() < -0.99
        assert 0.99 < values.max() <= 1
        assert abs(values.mean()) < 0.1
        assert abs(values.square().mean() - 1 / 3) < 0.05
    assert (population.output[:, :, 8:] == 0).all()


def test_every_generation_and_every_seed_has_its_own_chance_and_always_the_same():
    drawn_numbers = {
        (seed, generation): torch.rand(4, generator=generator_for(seed, generation, CPU)).tolist()
        for seed in (0, 1, 12345678901)
        for generation in range(5)
    }
    assert len({tuple(numbers) for numbers in drawn_numbers.values()}) == 15
    for (seed, generation), numbers in drawn_numbers.items():
        assert torch.rand(4, generator=generator_for(seed, generation, CPU)).tolist() == numbers
