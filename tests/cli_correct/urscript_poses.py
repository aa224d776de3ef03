"""Tool poses as URScript has them, and a posture and a tool for programs."""

import numpy as np
from scipy.spatial.transform import Rotation

HOME = [0.0, -1.6, 1.7, -1.65, -1.55, 0.1]
TOOL = np.eye(4)
TOOL[2, 3] = 0.12
SHAPE = "p[%.6f, %.6f, %.6f, %.6f, %.6f, %.6f]"


def written(X):
    """A tool pose ``(4, 4)`` as URScript has it."""
    return SHAPE % (*X[:3, 3], *Rotation.from_matrix(X[:3, :3]).as_rotvec())


def targets(text):
    """Numbers of the moves of a program, by line."""
    return {
        number: [float(each) for each in line.split("[", 1)[1].split("]")[0].split(",")]
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip().startswith("move")
    }
