"""Gradient training: exact derivatives, downhill, stopped by a validation part, and nothing learnt from noise."""

import numpy as np
import pytest
import torch
from by_loop import output_by_loop, random_network
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from truepath.residual.limits import Limits
from truepath.residual.network import Network
from truepath.residual.training import _Fit, train

CPU = torch.device("cpu")


def drawn(inputs, neurons, outputs, samples, seed=0):
    """A start, inputs and targets."""
    rng = np.random.default_rng(seed)
    network = random_network(rng, inputs, neurons, outputs)
    return network, rng.uniform(-1, 1, (samples, inputs)), rng.normal(size=(samples, outputs))


def misses(fit, x, target):
    """Function of the weights: ``(k N,)`` outputs less targets, written here for autograd."""
    x1 = torch.tensor(np.c_[x, np.ones(len(x))])
    hidden_count = fit.neurons * fit.inputs

    def of(weights):
        hidden = weights[:hidden_count].reshape(fit.neurons, fit.inputs)
        output = weights[hidden_count:].reshape(fit.outputs, fit.neurons + 1)
        said = 1.0 / (1.0 + torch.exp(-(hidden @ x1.T)))
        return (output[:, :-1] @ said + output[:, -1:] - torch.tensor(target.T)).ravel()

    return of


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def clean_at(x):
    """A smooth function ``(N, 3)`` of ``(N, 4)``, about one in size."""
    a, b, c, d = x.T
    return 1.65 * np.stack([np.sin(2 * a + b), c * d, np.cos(2 * b - d)], axis=1)


@pytest.fixture(scope="module")
def smooth():
    """Inputs, a smooth function of them, the same with noise of 0.3 of its size, and a validation part."""
    rng = np.random.default_rng(3)
    x = rng.uniform(-1, 1, (400, 4))
    clean = clean_at(x)
    return x, clean, clean + 0.3 * rng.normal(size=clean.shape), np.arange(400) % 6 == 0


# Derivatives


@hypothesis_settings(max_examples=25)
@given(
    inputs=st.integers(1, 6),
    neurons=st.integers(1, 7),
    outputs=st.integers(1, 6),
    samples=st.integers(1, 9),
    seed=st.integers(0, 999),
)
def test_gradient_and_normal_equations_are_those_of_autograd(inputs, neurons, outputs, samples, seed):
    network, x, target = drawn(inputs, neurons, outputs, samples, seed)
    fit = _Fit(network, x, target, CPU)
    of = misses(fit, x, target)
    fit.precision = torch.linspace(0.5, 2.0, (outputs + 2) // 3, dtype=torch.float64)  # of positions, of turns
    precision = torch.tensor([float(fit.precision[k // 3]) for k in range(outputs)]).repeat_interleave(samples)
    jacobian = torch.autograd.functional.jacobian(of, fit.weights)
    normal, gradient = fit._normal_equations(*fit.miss(fit.weights))
    torch.testing.assert_close(normal, jacobian.T @ (precision[:, None] * jacobian), rtol=1e-10, atol=1e-12)
    torch.testing.assert_close(gradient, jacobian.T @ (precision * of(fit.weights)), rtol=1e-10, atol=1e-12)


def test_weights_go_in_and_come_out_as_they_are():
    network, x, target = drawn(3, 5, 2, 4)
    fit = _Fit(network, x, target, CPU)
    found = fit.network(fit.weights)
    for name in ("hidden", "output", "bias"):
        np.testing.assert_array_equal(getattr(found, name), getattr(network, name))
    assert fit.rms(fit.weights) == pytest.approx(rms(output_by_loop(network, x) - target), rel=1e-12)


# Steps


def test_a_step_lowers_misses_and_weights_together_as_they_weigh_before_it(smooth):
    x, _, noisy, _ = smooth
    fit = _Fit(drawn(4, 8, 3, 1)[0], x, noisy, CPU)
    for _ in range(30):
        before, precision, decay = fit.weights, fit.precision.clone(), fit.decay[fit.group].clone()

        def cost(weights, precision=precision, decay=decay):
            network = fit.network(weights)
            squares = float(((network(x) - noisy) ** 2).sum())
            return 0.5 * float(precision) * squares + 0.5 * float((decay * weights**2).sum())

        if not fit.step():
            break
        assert cost(fit.weights) < cost(before)


def test_the_error_never_rises_where_weights_are_free(smooth, monkeypatch):
    x, clean, _, _ = smooth
    fit = _Fit(drawn(4, 8, 3, 1)[0], x, clean, CPU)
    fit.decay[:] = 0.0
    monkeypatch.setattr(fit, "_learn_sizes", lambda *_: None)
    errors = [fit.rms(fit.weights)]
    for _ in range(40):
        if not fit.step():
            break
        errors.append(fit.rms(fit.weights))
    assert (np.diff(errors) < 0).all()
    assert errors[-1] < 0.2 * errors[0]


def test_training_makes_no_error_larger_than_at_the_start(smooth):
    x, _, noisy, validation = smooth
    start = drawn(4, 10, 3, 1)[0]
    trained = train(start, x, noisy, validation)
    seen = ~validation
    assert trained.error < rms(start(x[seen]) - noisy[seen])
    assert trained.validation_error < rms(start(x[validation]) - noisy[validation])


# Stopping


def test_the_weights_with_the_lowest_validation_error_are_kept(smooth):
    x, _, noisy, validation = smooth
    start = drawn(4, 12, 3, 1)[0]
    errors = []
    for iterations in range(1, 26):
        stopped = train(start, x, noisy, validation, limits=Limits(iterations, 1000))
        errors.append(stopped.validation_error)
        found = rms(output_by_loop(stopped.network, x[validation]) - noisy[validation])
        assert stopped.validation_error == pytest.approx(found, rel=1e-9)
        assert stopped.error == pytest.approx(rms(output_by_loop(stopped.network, x[~validation]) - noisy[~validation]))
    assert (np.diff(errors) <= 0).all()


def test_it_stops_when_the_validation_error_has_not_fallen_for_so_long(smooth):
    x, _, noisy, validation = smooth
    few = np.flatnonzero(~validation)[:30]  # more weights than readings
    rows = np.r_[few, np.flatnonzero(validation)]
    start = drawn(4, 12, 3, 1)[0]
    part = x[rows], noisy[rows], validation[rows]
    patient, hasty = (train(start, *part, limits=Limits(500, patience)) for patience in (60, 3))
    assert hasty.iterations < patient.iterations < 500
    assert patient.validation_error <= hasty.validation_error


def test_no_more_iterations_are_made_than_allowed(smooth):
    x, _, noisy, validation = smooth
    assert train(drawn(4, 5, 3, 1)[0], x, noisy, validation, limits=Limits(4, 100)).iterations == 4


def test_validation_samples_are_not_learnt_from(smooth):
    x, _, noisy, validation = smooth
    start, limits = drawn(4, 8, 3, 1)[0], Limits(1, 100)
    spoilt = np.where(validation[:, None], noisy + 1e-9 * np.arange(400)[:, None], noisy)
    for name in ("hidden", "output", "bias"):
        one, other = (train(start, x, each, validation, limits=limits).network for each in (noisy, spoilt))
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_without_a_validation_part_the_samples_themselves_decide(smooth):
    x, clean, _, _ = smooth
    trained = train(drawn(4, 8, 3, 1)[0], x, clean, np.zeros(400, bool))
    assert trained.error == trained.validation_error < 0.2


# What is learnt


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_of_pure_noise_nearly_nothing_is_learnt(seed):
    rng = np.random.default_rng(seed)
    x, noise = rng.uniform(-1, 1, (400, 6)), rng.normal(size=(400, 3))
    network = train(drawn(6, 15, 3, 1, seed)[0], x, noise, np.arange(400) % 6 == 0).network
    assert rms(network(rng.uniform(-1, 1, (2000, 6)))) < 0.2


@pytest.mark.parametrize("seed", [0, 1])
def test_a_smooth_function_comes_out_of_the_noise_to_a_third_of_it(seed):
    rng = np.random.default_rng(seed)
    x, fresh = rng.uniform(-1, 1, (1000, 4)), rng.uniform(-1, 1, (2000, 4))
    noisy = clean_at(x) + 0.3 * rng.normal(size=(1000, 3))
    network = train(drawn(4, 15, 3, 1, seed)[0], x, noisy, np.arange(1000) % 6 == 0).network
    assert rms(network(fresh) - clean_at(fresh)) < 0.1


def test_turns_that_are_nothing_but_noise_are_not_learnt_and_do_not_disturb_the_positions():
    rng = np.random.default_rng(6)
    x, fresh, validation = rng.uniform(-1, 1, (300, 4)), rng.uniform(-1, 1, (2000, 4)), np.arange(300) % 6 == 0
    positions, turns = clean_at(x) + 0.1 * rng.normal(size=(300, 3)), rng.normal(size=(300, 3))
    both = train(drawn(4, 12, 6, 1)[0], x, np.c_[positions, turns], validation).network(fresh)
    alone = train(drawn(4, 12, 3, 1)[0], x, positions, validation).network(fresh)
    assert rms(both[:, 3:]) < 0.2
    assert rms(both[:, :3] - clean_at(fresh)) < 1.2 * rms(alone - clean_at(fresh))


def test_without_noise_a_network_is_found_again():
    rng = np.random.default_rng(4)
    hidden, x = random_network(rng, 3, 3, 2, size=2.0), rng.uniform(-1, 1, (300, 3))
    trained = train(drawn(3, 8, 2, 1)[0], x, hidden(x), np.arange(300) % 5 == 0, limits=Limits(400, 100))
    fresh = rng.uniform(-1, 1, (500, 3))
    assert rms(trained.network(fresh) - hidden(fresh)) < 1e-3 * rms(hidden(fresh) - hidden(fresh).mean(axis=0))


def test_the_same_input_gives_the_same_bits(smooth):
    x, _, noisy, validation = smooth
    one, other = (train(drawn(4, 9, 3, 1)[0], x, noisy, validation, limits=Limits(20, 9)).network for _ in range(2))
    for name in ("hidden", "output", "bias"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


# Odd input


@pytest.mark.parametrize(
    ("samples", "target"),
    [(1, 0.5), (2, 0.0), (50, 0.0), (50, 3.0), (5, 1e-9), (5, 1e9)],
    ids=["one sample", "two zeros", "all zero", "all the same", "tiny", "huge"],
)
def test_degenerate_targets_end_in_numbers(samples, target):
    network, x, _ = drawn(3, 4, 2, samples)
    trained = train(network, x, np.full((samples, 2), target), np.zeros(samples, bool), limits=Limits(50, 20))
    assert isinstance(trained.network, Network)
    assert np.isfinite(trained.network(x)).all()
    assert rms(trained.network(x) - target) <= max(rms(network(x) - target), 1e-6)


def test_a_joint_that_never_moved_is_no_trouble(smooth):
    x, _, noisy, validation = smooth
    still = x.copy()
    still[:, 2] = 0.0
    network = train(drawn(4, 8, 3, 1)[0], still, noisy, validation, limits=Limits(40, 20)).network
    assert np.isfinite(network(x)).all()
