"""Robots from Drake with an error that no named cause has: the probe strays as a smooth function of several joints."""

import numpy as np
from drake_arm import DrakeArm
from scipy.spatial.transform import Rotation
from truepath.measurements import Measurements
from truepath.residual.limits import Limits, Settings
from truepath.residual.options import Options

CENTRE = np.array([0.2, -1.2, 1.1, -0.7, 0.9, 0.3])
P_FE = np.array([0.03, -0.02, 0.05])
QUICK = Options(
    evolution=Settings(individuals=8, smallest=8, largest=12, generations=5), limits=Limits(40, 12), members=3
)


def joints(count, seed, half_range=1.0):
    """``(count, 6)`` within so many radians of the centre, a joint each."""
    return CENTRE + half_range * np.random.default_rng(seed).uniform(-1, 1, (count, 6))


def stray(q, size_m=1e-4):
    """``(N, 3)`` about as long as ``size_m``, m."""
    a, b, c = q[:, :3].T
    return size_m * np.stack([np.sin(2 * a + 2 * c), np.cos(2 * b - 1.5 * c), np.sin(2 * b + a)], axis=1)


def true_positions(arm, q, size_m=1e-4):
    """``(N, 3)`` of the probe in the base, by Drake and the formula above."""
    return (arm.flange_poses(q) @ [*P_FE, 1.0])[:, :3] + stray(q, size_m)


def campaign(arm, q, size_m=1e-4, noise_mm=0.02, seed=0, turn_noise_mrad=None, drift=None):
    """What a tracker sees; with ``drift`` ``(N, 3)`` m added, with orientations where their noise is given."""
    rng = np.random.default_rng(seed + 1000)
    p_ME = true_positions(arm, q, size_m) + 1e-3 * noise_mm * rng.normal(size=(len(q), 3))
    R_ME = None
    if turn_noise_mrad is not None:
        turn = Rotation.from_rotvec(1e-3 * turn_noise_mrad * rng.normal(size=(len(q), 3))).as_matrix()
        R_ME = turn @ arm.flange_poses(q)[:, :3, :3]
    return Measurements(q_rad=q, p_ME=p_ME if drift is None else p_ME + drift, R_ME=R_ME)


def mean_error_mm(model, q, truth):
    """Against true positions, mm."""
    return float(1e3 * np.linalg.norm(model.predict(q)[:, :3, 3] - truth, axis=1).mean())


def arm(seed):
    """A UR5 with hidden errors of its frames."""
    return DrakeArm("ur5", seed)
