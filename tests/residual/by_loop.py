"""The paper's network once more, neuron by neuron in plain Python: what the tests compare with."""

import math

import numpy as np
from truepath.residual.network import Network


def random_network(rng, inputs, neurons, outputs, size=1.0):
    """A network with weights drawn from -size to size."""
    shapes = ((neurons, inputs + 1), (outputs, neurons), (outputs,))
    return Network(*(size * rng.uniform(-1, 1, shape) for shape in shapes))


def output_by_loop(network, x):
    """``(N, k)`` by eq. 12 (with a threshold), 13 (with its sign mended) and 14 (with a threshold)."""
    answers = []
    for row in x:
        said = []
        for weights in network.hidden:
            total = float(weights[-1])
            for i, value in enumerate(row):
                total += float(weights[i]) * float(value)
            said.append(1.0 / (1.0 + math.exp(-total)))
        answer = []
        for k, threshold in enumerate(network.bias):
            answer.append(float(threshold) + sum(float(network.output[k, j]) * said[j] for j in range(len(said))))
        answers.append(answer)
    return np.array(answers).reshape(len(x), len(network.bias))


def error_by_loop(network, x, target):
    """The residual mean squared error of eq. 15: squared lengths of the misses, averaged over the samples."""
    misses = output_by_loop(network, x) - target
    return sum(float(component) ** 2 for miss in misses for component in miss) / len(x)


def genes(population, number):
    """All numbers of one individual by name: hidden, output, bias."""
    network = population.network(number)
    return {name: getattr(network, name) for name in ("hidden", "output", "bias")}
