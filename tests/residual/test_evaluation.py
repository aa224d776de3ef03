"""What numpy computes on all cores is what each network misses alone, whoever computes it."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from by_loop import error_by_loop, random_network
from threadpoolctl import threadpool_info, threadpool_limits
from truepath.residual.evaluation import share_out, squared_misses

NETWORKS, INPUTS, NEURONS, OUTPUTS, SAMPLES = 5, 3, 7, 2, 11


def blas_threads():
    """Of the libraries that numpy's products may run in."""
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


@pytest.mark.parametrize(("precision", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_squared_misses_are_those_of_each_network_alone(precision, tolerance):
    rng = np.random.default_rng(0)
    networks = [random_network(rng, INPUTS, NEURONS, OUTPUTS, size=3.0) for _ in range(NETWORKS)]
    x, target = rng.uniform(-1, 1, (SAMPLES, INPUTS)), rng.normal(size=(SAMPLES, OUTPUTS))
    genes = np.stack([np.c_[network.hidden, network.output.T] for network in networks])
    bias = np.stack([network.bias for network in networks])
    x1 = np.r_[x.T, np.ones((1, SAMPLES))]
    found = squared_misses(*(part.astype(precision) for part in (genes, bias, x1, target.T)))
    assert found.dtype == precision
    expected = [SAMPLES * error_by_loop(network, x, target) for network in networks]
    np.testing.assert_allclose(found, expected, rtol=tolerance)


def test_weights_are_left_as_they_are():
    rng = np.random.default_rng(0)
    parts = [rng.normal(size=shape) for shape in ((2, 4, 5), (2, 2), (3, 6), (2, 6))]
    before = [part.copy() for part in parts]
    squared_misses(*parts)
    for part, same in zip(parts, before, strict=True):
        np.testing.assert_array_equal(part, same)


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


def test_products_are_kept_to_one_core_for_as_long_as_it_takes_and_no_longer():
    seen = []
    with threadpool_limits(2, user_api="blas"):
        before = blas_threads()
        share_out(lambda _: seen.append(blas_threads()), [1, 2], 2)
        after = blas_threads()
    assert len(before) > 0
    assert seen == [[1] * len(before)] * 2
    assert after == before == [2] * len(before)
