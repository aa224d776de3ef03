"""The readings with the kinematics taken out: what is left is all that an effect can be told by.

Readings are y = J p + A x + noise. Integrating over p with its Gaussian prior leaves a problem in x alone, with y
and A projected off J (the Frisch-Waugh theorem). For wide priors that is exact; where a prior is tight it errs on the
careful side. A cause that free
kinematics can imitate has no column left then, and no evidence can speak for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dtrtrs

from truepath.evidence import LinearProblem
from truepath.lie import Array


@dataclass(frozen=True)
class Marginal:
    """N poses of m readings in units of their noise, k parameters taken out.

    Attributes:
        sigma: ``(m,)`` noise of the readings, m and rad.
        Q: ``(N m, k)`` whitened derivatives by the parameters, J L^-T with L L^T = J^T J and the prior: what the
            parameters can do to readings r is Q Q^T r.
        y: ``(N, m)`` whitened readings, projected.
        spent: number of readings of each kind that the parameters use up.
    """

    sigma: Array
    Q: Array
    y: Array
    spent: tuple[float, ...]

    @classmethod
    def of(cls, y: Array, J: Array, prior_sigma: Array, sigma: Array) -> Marginal:
        """From readings ``(N, m)``, derivatives ``(N, m, k)``, prior widths ``(k,)`` and noise ``(m,)``."""
        rows = (J / sigma[:, None]).reshape(J.shape[0] * J.shape[1], J.shape[2])
        H = rows.T @ rows
        scale = (np.diag(H) + prior_sigma**-2.0) ** -0.5
        H *= scale[:, None] * scale
        factor = np.linalg.cholesky(H + np.diag((scale / prior_sigma) ** 2))
        Q = np.ascontiguousarray(dtrtrs(factor, (rows * scale).T, lower=True)[0].T)
        whitened = (y / sigma).ravel()
        left = whitened - Q @ (Q.T @ whitened)
        leverage = np.einsum("rk,rk->r", Q, Q).reshape(y.shape)
        spent = tuple(float(leverage[:, k : k + 3].sum()) for k in range(0, y.shape[1], 3))
        return cls(sigma, Q, left.reshape(y.shape), spent)

    def project(self, A: Array) -> Array:
        """``(N, m, K)`` columns in m and rad, whitened and without what the kinematics can imitate."""
        rows = (A / self.sigma[:, None]).reshape(A.shape[0] * A.shape[1], A.shape[2])
        rows -= self.Q @ (self.Q.T @ rows)
        return rows.reshape(A.shape)

    def first(self, count: int) -> Marginal:
        """With only the first ``count`` parameters taken out; y stays as it is. To rank columns, and fast."""
        return Marginal(self.sigma, self.Q[:, :count], self.y, self.spent)

    def problem(self, projected: Array, y: Array | None = None) -> LinearProblem:
        """Of projected columns ``(N, m, K)``; noise is 1 per kind of reading."""
        return LinearProblem.of(projected, self.y if y is None else y, self.spent)
