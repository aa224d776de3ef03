"""Where the tracker of these tests stands and what it sees."""

import numpy as np

TRACKER = np.array([2.5, 1.0, 1.2])
CONE_DEG, NEAREST_M, FARTHEST_M = 30.0, 0.5, 4.0
