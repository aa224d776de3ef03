"""The networks of a calibration for one pose, as a CasADi function: ``NetworkResidual.shift`` for a control loop."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from truepath.lie import Array
from truepath.residual.ensemble import NetworkResidual
from truepath.residual.reach import FADES_FROM, FADES_TO, JOINT_FADE_RAD, SHARPNESS, Reach


@lru_cache(maxsize=8)
def network_shift(residual: NetworkResidual) -> ca.Function:
    """CasADi function of commanded joints ``(n)``: shift and turn of the probe ``(6)``, m and rad, in the real base.

    Of matrices, not of scalars: there are some thousand weights and some hundred measured poses.
    """
    reach, count = residual.reach, len(residual.networks)
    q = ca.MX.sym("q", len(reach.lower_rad))
    x = (q - reach.middle_rad) / reach.half_range_rad
    hidden = np.concatenate([network.hidden for network in residual.networks])
    activation = 1.0 / (1.0 + ca.exp(-(ca.mtimes(ca.DM(hidden[:, :-1]), x) + hidden[:, -1])))
    scale = residual.scale / count
    output = scale[:, None] * np.concatenate([network.output for network in residual.networks], axis=1)
    bias = scale * np.sum([network.bias for network in residual.networks], axis=0)
    said = (ca.mtimes(ca.DM(output), activation) + bias) * _weight(reach, q, x)
    silent = ca.MX.zeros(6 - len(scale)) if len(scale) < 6 else ca.MX(0, 1)
    return ca.Function("network_shift", [q], [ca.densify(ca.vertcat(said, silent))])


def _weight(reach: Reach, q: ca.MX, x: ca.MX) -> ca.MX:
    """``Reach.weight``."""
    beyond = ca.fmax(reach.lower_rad - q, q - reach.upper_rad)
    alone = _smooth_step(1.0 - beyond / JOINT_FADE_RAD)
    poses: Array = reach.scaled(reach.poses_rad)
    square = ca.fmax(ca.sumsqr(x) + np.sum(poses**2, axis=1) - 2.0 * ca.mtimes(ca.DM(poses), x), 0.0)
    sharpness, nearest = SHARPNESS / reach.median**2, ca.mmin(square)
    nearest -= ca.log(ca.sum1(ca.exp(-sharpness * (square - nearest)))) / sharpness
    distance = ca.sqrt(ca.fmax(nearest, 0.0))
    together = _smooth_step((FADES_TO - distance / reach.spacing) / (FADES_TO - FADES_FROM))
    for k in range(alone.shape[0]):
        together *= alone[k]
    return together


def _smooth_step(t: ca.MX) -> ca.MX:
    """``region.smooth_step``."""
    t = ca.fmin(ca.fmax(t, 0.0), 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
