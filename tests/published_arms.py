"""The arms that Universal Robots has published, and files that say how one differs."""

from dataclasses import replace

import numpy as np
from denavit_hartenberg import frames, table

MODELS = {"ur5": "UR5", "ur10": "UR10"}


X_0T = np.array([[0, 0, 1, 0.02], [0, 1, 0, -0.01], [-1, 0, 0, 0.15], [0, 0, 0, 1]], float)


def joints(count=30, seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 6))


def robot_of(ur5, model):
    """A robot with the axes of a published model."""
    seven = np.array(frames(table(model), np.zeros(6)))
    return replace(ur5, name=model, X_BA=seven[:6], X_BF=seven[6])


def written(path, content):
    """The path, at which the text or the bytes now stand."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path
