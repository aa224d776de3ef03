"""A neural residual that nobody trained: smooth, of a known size, and with a known reach."""

import numpy as np
from truepath.residual.ensemble import NetworkResidual
from truepath.residual.network import Network
from truepath.residual.reach import Reach


def residual_about(q_rad, *, half_width_rad=0.35, size_m=1e-4, outputs=3, members=3, poses=400, seed=0):
    """Networks that say something of ``size_m`` (and rad) about joints ``(n,)``, in a box that was measured densely.

    The members differ by a fifth of that.
    """
    rng, n = np.random.default_rng(seed), len(q_rad)
    common = rng.normal(size=(8, n + 1)), rng.normal(size=(outputs, 8)), rng.normal(size=outputs)
    networks = [Network(*(part + 0.2 * rng.normal(size=part.shape) for part in common)) for _ in range(members)]
    measured = q_rad + rng.uniform(-half_width_rad, half_width_rad, (poses, n))
    return NetworkResidual(tuple(networks), np.full(outputs, size_m), Reach.of(measured))
