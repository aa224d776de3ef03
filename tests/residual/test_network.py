"""The network is the one of the paper's eq. 12 to 14, and many of them at once are each as they are alone."""

import numpy as np
import pytest
import torch
from by_loop import output_by_loop, random_network
from hypothesis import given
from hypothesis import strategies as st
from truepath.residual.network import Network, one_thread, outputs


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.mark.parametrize(("inputs", "neurons", "outputs"), [(6, 12, 3), (6, 1, 6), (1, 5, 1), (7, 40, 3)])
def test_outputs_are_those_of_equations_12_to_14(rng, inputs, neurons, outputs):
    network, x = random_network(rng, inputs, neurons, outputs, size=2.0), rng.uniform(-1.5, 1.5, (25, inputs))
    np.testing.assert_allclose(network(x), output_by_loop(network, x), atol=1e-13)


def test_a_neuron_rises_with_its_input(rng):
    """The paper's eq. 13 has the sign wrong: 1 / (1 + exp(x)) would fall."""
    rising = Network(np.array([[3.0, 0.0]]), np.array([[1.0]]), np.array([0.0]))
    assert (np.diff(rising(np.linspace(-2, 2, 9)[:, None])[:, 0]) > 0).all()
    assert rising(np.zeros((1, 1)))[0, 0] == 0.5


def test_the_threshold_of_a_neuron_stands_last_among_its_weights():
    network = Network(np.array([[0.0, 0.0, 1.25]]), np.array([[1.0]]), np.array([0.0]))
    np.testing.assert_allclose(network(np.array([[3.0, -2.0]])), 1 / (1 + np.exp(-1.25)), rtol=1e-15)


def test_huge_inputs_saturate_a_neuron_and_are_no_trouble():
    network = Network(np.array([[1e6, 0.0]]), np.array([[2.0], [-1.0]]), np.array([0.0, 0.5]))
    np.testing.assert_array_equal(network(np.array([[1e3], [-1e3]])), [[2.0, -0.5], [0.0, 0.5]])


@given(inputs=st.integers(1, 7), neurons=st.integers(1, 40), outputs=st.integers(1, 6))
def test_it_has_as_many_weights_and_thresholds_as_equation_18_says(inputs, neurons, outputs):
    network = random_network(np.random.default_rng(1), inputs, neurons, outputs)
    by_counting = network.hidden.size + network.output.size + network.bias.size
    assert by_counting == inputs * neurons + neurons + neurons * outputs + outputs
    assert network.neurons == neurons


@given(sizes=st.lists(st.integers(1, 20), min_size=1, max_size=6), seed=st.integers(0, 1000))
def test_networks_of_different_size_say_together_what_each_says_alone(sizes, seed):
    rng = np.random.default_rng(seed)
    networks = [random_network(rng, 4, size, 3, size=3.0) for size in sizes]
    x = rng.uniform(-1, 1, (7, 4))
    together = outputs(networks, x)
    assert together.shape == (len(sizes), 7, 3)
    for network, said in zip(networks, together, strict=True):
        np.testing.assert_allclose(said, output_by_loop(network, x), atol=1e-12)


def test_numbers_are_in_double_precision(rng):
    network, x = random_network(rng, 6, 20, 3), rng.uniform(-1, 1, (5, 6))
    assert network(x).dtype == np.float64


def test_joints_in_any_memory_layout_are_the_same_joints(rng):
    network, x = random_network(rng, 6, 8, 3), rng.uniform(-1, 1, (10, 6))
    for other in (np.asfortranarray(x), np.repeat(x, 2, axis=0)[::2], x[::-1][::-1]):
        np.testing.assert_array_equal(network(other), network(x))


def test_no_pose_has_no_output(rng):
    assert random_network(rng, 6, 8, 3)(np.zeros((0, 6))).shape == (0, 3)


def test_one_thread_gives_back_the_threads_that_it_took_even_after_a_fault():
    before = torch.get_num_threads()
    with one_thread():
        assert torch.get_num_threads() == 1
    assert torch.get_num_threads() == before
    with pytest.raises(ZeroDivisionError), one_thread():
        raise ZeroDivisionError
    assert torch.get_num_threads() == before
