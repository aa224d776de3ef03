"""The readings with the kinematics taken out: what is left is all that an effect can be told by.

Readings are y = J p + A x + noise. Integrating over p with its Gaussian prior leaves a problem in x alone, with y
and A projected off J (the Frisch-Waugh theorem; the prior enters as readings of its own). A cause that free
kinematics can imitate has no column left then, and no evidence can speak for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from truepath.evidence import LinearProblem
from truepath.lie import Array


@dataclass(frozen=True)
class Marginal:
    """N poses of m readings in units of their noise, k parameters taken out.

    Attributes:
        sigma: ``(m,)`` noise of the readings, m and rad.
        Q: ``(N m, k)`` J R^-1, R the triangular factor of J and the prior.
        y: ``(N, m)`` whitened readings, projected.
    """

    sigma: Array
    Q: Array
    y: Array

    @classmethod
    def of(cls, y: Array, J: Array, prior_sigma: Array, sigma: Array) -> Marginal:
        """From readings ``(N, m)``, derivatives ``(N, m, k)``, prior widths ``(k,)`` and noise ``(m,)``."""
        rows = (J / sigma[:, None]).reshape(J.shape[0] * J.shape[1], J.shape[2])
        R = np.linalg.qr(np.concatenate([rows, np.diag(1.0 / prior_sigma)]), mode="r")
        Q = solve_triangular(R, rows.T, trans="T").T
        whitened = (y / sigma).ravel()
        return cls(sigma, Q, (whitened - Q @ (Q.T @ whitened)).reshape(y.shape))

    def project(self, A: Array) -> Array:
        """``(N, m, K)`` columns in m and rad, whitened and without what the kinematics can imitate."""
        rows = (A / self.sigma[:, None]).reshape(A.shape[0] * A.shape[1], A.shape[2])
        return (rows - self.Q @ (self.Q.T @ rows)).reshape(A.shape)

    def first(self, count: int) -> Marginal:
        """With only the first ``count`` parameters taken out; y stays as it is. To rank columns, and fast."""
        return Marginal(self.sigma, self.Q[:, :count], self.y)

    def problem(self, projected: Array, y: Array | None = None) -> LinearProblem:
        """Of projected columns ``(N, m, K)``; noise is 1 per kind of reading."""
        spent = float(np.sum(self.Q**2)) / (len(self.sigma) // 3)
        return LinearProblem.of(projected, self.y if y is None else y, spent)
