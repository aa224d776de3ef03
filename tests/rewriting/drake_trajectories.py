"""Drake trajectories of every kind."""

import numpy as np
from pydrake.math import BsplineBasis
from pydrake.trajectories import (
    BezierCurve,
    BsplineTrajectory,
    CompositeTrajectory,
    FunctionHandleTrajectory,
    PathParameterizedTrajectory,
    PiecewisePolynomial,
)

READY = np.array([0.3, -1.6, -1.8, -1.2, 1.5, 0.2])


def joints(seed=0, count=6, spread=0.4):
    return READY + np.random.default_rng(seed).uniform(-spread, spread, (count, 6))


def cubic(q=None, seconds=6.0):
    """From rest to rest."""
    q = joints() if q is None else q
    return PiecewisePolynomial.CubicShapePreserving(np.linspace(0, seconds, len(q)), q.T, True)


def swinging(t):
    return (READY + 0.3 * np.sin(t + np.arange(6)))[:, None]


def kinds():
    """A trajectory of each kind."""
    q = joints(1)
    times = np.linspace(0, 6, 6)
    basis = BsplineBasis(5, 6, initial_parameter_value=0.0, final_parameter_value=6.0)
    columns = [row[:, None] for row in q]
    first_order = PiecewisePolynomial.FirstOrderHold(times, q.T)
    pace = PiecewisePolynomial.CubicShapePreserving([0, 4.0, 9.0], [[0, 4, 6.0]], True)
    return {
        "cubic": cubic(),
        "first order": first_order,
        "later": PiecewisePolynomial.CubicWithContinuousSecondDerivatives(times + 3.0, q.T),
        "degree 7": PiecewisePolynomial.LagrangeInterpolatingPolynomial(np.linspace(0, 6, 8), joints(2, 8, 0.1).T),
        "bspline": BsplineTrajectory(basis, columns),
        "bezier": BezierCurve(0.0, 6.0, q.T),
        "composite": CompositeTrajectory(
            [cubic(q), PiecewisePolynomial.FirstOrderHold([6.0, 7.0], q[[5, 0]].T), BezierCurve(7.0, 8.0, q[[0, 1]].T)]
        ),
        "path with a pace": PathParameterizedTrajectory(cubic(q), pace),
        "function": FunctionHandleTrajectory(swinging, 6, 1, 0.0, 6.0),
    }
