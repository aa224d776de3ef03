"""A path to correct, and the poses of a virtual robot that are measured for it."""

import numpy as np
from truepath.virtual.simulate import Campaign, free_poses, measure

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])


def measured(real):
    """300 poses of a virtual robot, measured in the world's frame."""
    return measure(real, free_poses(real, 300, np.random.default_rng(0)), Campaign())


def smooth_path():
    """``(100, 6)`` joints of a smooth path away from singularities."""
    s = np.linspace(0, 1, 100)[:, None]
    return HOME + s * [0.5, 0.3, -0.4, 0.2, 0.4, 0.6]
