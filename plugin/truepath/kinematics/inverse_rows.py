"""Inverses of the Jacobians of six-jointed arms, for rows of poses."""

from __future__ import annotations

import numpy as np

from truepath.lie import Array


class InverseRows:
    """Inverts ``(6, 6)`` matrices by Gram and Schmidt's orthogonal columns, which needs no exchange of rows.

    In single precision: steps of an iteration need no more, and it halves the time.

    Args:
        N: matrices.

    Attributes:
        inverse: ``(6, 6, N)`` rows of the inverse; not finite where a matrix is singular.
    """

    def __init__(self, N: int) -> None:
        self.inverse = np.empty((6, 6, N), np.float32)
        self._columns, self._products, self._R = np.empty((3, 6, 6, N), np.float32)

    def of(self, columns: Array) -> Array:
        """The inverses of matrices with ``columns (6, 6, N)``, column by column; the memory of ``inverse``."""
        Q, R, products = self._columns, self._R, self._products
        np.copyto(Q, columns)
        for i in range(6):
            own, later = Q[i], Q[i + 1 :]
            np.multiply(own, own, products[0])
            length = np.sqrt(np.add.reduce(products[0], axis=0), out=R[i, i])
            np.divide(1.0, length, length)
            own *= length
            part = products[i + 1 :]
            np.multiply(later, own, part)
            r = np.add.reduce(part, axis=1, out=R[i, i + 1 :])
            np.multiply(r[:, None], own, part)
            later -= part
        # R inverse = Q transposed, solved from below.
        G = self.inverse
        np.copyto(G, Q)
        for i in range(5, -1, -1):
            G[i] *= R[i, i]
            part = products[:i]
            np.multiply(R[:i, i, None], G[i], part)
            G[:i] -= part
        return G

    def applied(self, vectors: Array) -> Array:
        """``(6, N)`` inverse times vectors ``(6, N)``."""
        np.multiply(self.inverse, vectors.astype(np.float32), self._products)
        return np.add.reduce(self._products, axis=1)

    def least_singular_value(self) -> Array:
        """``(N,)`` a lower bound of the smallest singular value: 1 / |inverse| (Frobenius), at most sqrt 6 too low."""
        np.multiply(self.inverse, self.inverse, self._products)
        return 1.0 / np.sqrt(np.add.reduce(self._products.reshape(36, -1), axis=0))
