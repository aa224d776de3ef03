"""The robot behind the virtual controller of these tests."""

import numpy as np

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
SEED, HIDDEN = 5, ("backlash",)
