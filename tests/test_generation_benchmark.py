"""The benchmark of a generation compares like with like: the peers' errors are those of our own evaluation."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from truepath.residual.network import Network, with_ones
from truepath.residual.population import Population

WORKFLOWS = Path(__file__).parents[1] / "workflows"
INPUTS, OUTPUTS, SAMPLES = 6, 3, 40


@pytest.fixture
def networks():
    rng = np.random.default_rng(0)
    return [
        Network(rng.normal(size=(count, INPUTS + 1)), rng.normal(size=(OUTPUTS, count)), rng.normal(size=OUTPUTS))
        for count in (3, 9, 5, 7)
    ]


@pytest.fixture
def samples():
    rng = np.random.default_rng(1)
    return rng.uniform(-1, 1, (SAMPLES, INPUTS)), rng.normal(size=(SAMPLES, OUTPUTS))


@pytest.fixture
def peers(monkeypatch):
    monkeypatch.syspath_prepend(str(WORKFLOWS))
    from peers import one_network_at_a_time

    return one_network_at_a_time


def vector(network: Network) -> np.ndarray:
    return np.concatenate([np.concatenate([network.hidden, network.output.T], axis=1).ravel(), network.bias])


def test_a_vector_has_the_length_of_equation_18(networks):
    assert [len(vector(network)) for network in networks] == [
        INPUTS * n + n + n * OUTPUTS + OUTPUTS for n in (3, 9, 5, 7)
    ]


@pytest.mark.parametrize("peer", ["WithNumpy", "WithTorch"])
def test_all_see_the_same_errors(peers, peer, networks, samples):
    x, target = samples
    population = Population.of(networks, 12, torch.device("cpu"), torch.float64)
    ours = population.mean_squared_error(with_ones(torch.from_numpy(x)), torch.from_numpy(target.T.copy()))
    theirs = np.array(getattr(peers, peer)(x, target, [vector(n) for n in networks], seed=0).errors)
    per_sample = theirs * (OUTPUTS if peer == "WithTorch" else 1)  # torch's mse_loss is a mean over the outputs too
    assert per_sample == pytest.approx(ours.numpy(), rel=1e-5)


@pytest.mark.parametrize("peer", ["WithNumpy", "WithTorch"])
def test_a_peer_evolves(peers, peer, networks, samples):
    evolution = getattr(peers, peer)(*samples, [vector(n) for n in networks], seed=0)
    before = list(evolution.errors)
    for _ in range(20):
        evolution.generation()
    assert all(now <= then for now, then in zip(evolution.errors, before, strict=True))
    assert min(evolution.errors) < min(before)


def test_it_prints_what_it_measured():
    command = [sys.executable, WORKFLOWS / "generation_benchmark.py", "--individuals", "8", "--largest", "5"]
    done = subprocess.run([*command, "--poses", "50", "--rounds", "2"], capture_output=True, text=True, check=True)
    result = json.loads(done.stdout)
    assert [each["neurons_of_the_best"] for each in result["by_size"]] == [1, 2, 3, 4, 5]
    assert result["dearest"] == result["by_size"][-1]
    for name in ("batched_s", "torch_s", "numpy_s"):
        assert result[name] == pytest.approx(np.mean([each[name] for each in result["by_size"]]))
        assert result[name] > 0
