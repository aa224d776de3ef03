"""What all cores compute is what each network misses alone, whoever computes it."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from by_loop import error_by_loop, random_network
from truepath.residual.evaluation import share_out, squared_misses

INPUTS, OUTPUTS = 3, 2


def drawn(sizes, samples, size=3.0):
    """Networks of these sizes, inputs ``(N, 3)`` and targets ``(N, 2)``."""
    rng = np.random.default_rng(samples)
    networks = [random_network(rng, INPUTS, neurons, OUTPUTS, size) for neurons in sizes]
    return networks, rng.uniform(-1, 1, (samples, INPUTS)), rng.normal(size=(samples, OUTPUTS))


def arguments(networks, x, target, precision=np.float64):
    """As ``squared_misses`` takes them; where a network has no neuron there is nonsense."""
    genes = np.full((len(networks), max(n.neurons for n in networks) + 1, INPUTS + 1 + OUTPUTS), 1e6, precision)
    for own, network in zip(genes, networks, strict=True):
        own[: network.neurons] = np.c_[network.hidden, network.output.T]
    bias, sizes = np.stack([network.bias for network in networks]), np.array([n.neurons for n in networks])
    x1 = np.r_[x.T, np.ones((1, len(x)))]
    return genes, bias.astype(precision), sizes, x1.astype(precision), target.T.astype(precision)


@pytest.mark.parametrize(("precision", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-5)])
@pytest.mark.parametrize("samples", [1, 11, 1024, 1025, 2060])
def test_squared_misses_are_those_of_each_network_alone(samples, precision, tolerance):
    networks, x, target = drawn([7, 1, 2, 8, 5], samples)
    found = squared_misses(*arguments(networks, x, target, precision))
    assert found.dtype == precision
    expected = [samples * error_by_loop(network, x, target) for network in networks]
    np.testing.assert_allclose(found, expected, rtol=tolerance)


def test_weights_are_left_as_they_are():
    parts = arguments(*drawn([4, 3], samples=6))
    before = [part.copy() for part in parts]
    squared_misses(*parts)
    for part, same in zip(parts, before, strict=True):
        np.testing.assert_array_equal(part, same)


def test_many_networks_are_the_same_to_the_last_bit_on_any_number_of_threads():
    parts = arguments(*drawn([3, 8, 20, 40] * 10, samples=300), np.float32)
    alone = squared_misses(*parts)
    for threads in (2, 3, 8):
        np.testing.assert_array_equal(squared_misses(*parts, threads=threads), alone)


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 3, 50])
def test_each_item_is_done_once_by_however_many(threads, count):
    done = []
    share_out(done.append, list(range(count)), threads)
    assert sorted(done) == list(range(count))


def test_two_threads_work_at_the_same_time():
    """Each waits for the other: one thread alone would wait for ever."""
    meeting = threading.Barrier(2)
    share_out(lambda _: meeting.wait(timeout=20.0), [1, 2], 2)
    assert not meeting.broken


def test_more_threads_than_there_are_helpers_do_not_wait_for_each_other():
    def one(number):
        done = []
        share_out(done.append, list(range(20)), 50)
        return len(done) + number

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(one, range(30))) == [20 + number for number in range(30)]


@pytest.mark.parametrize("threads", [1, 3])
def test_a_fault_is_told(threads):
    def fail(number):
        if number == 7:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        share_out(fail, list(range(20)), threads)
