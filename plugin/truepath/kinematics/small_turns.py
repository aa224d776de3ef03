"""Turns that are small, by their power series: exact to the last bits of a double, and far cheaper than sines.

Turns are the vector parts ``v (3, N)`` of unit quaternions with a positive scalar part.
"""

from __future__ import annotations

import numpy as np

from truepath.kinematics.chain_rows import cross
from truepath.lie import Array

LARGEST_RAD = 0.1  # of an angle; the first power of it that is left out is its tenth


def turn_on(waves: Array, angle: Array, out: Array, scratch: Array) -> None:
    """Sines and cosines of angles to each of which a small one was added.

    Args:
        waves: ``(2, n, N)`` sines and cosines; not the memory of the results.
        angle: ``(n, N)`` what is added, up to 0.1 rad.
        out: ``(2, n, N)`` results.
        scratch: ``(3, n, N)``.
    """
    sin, cos = waves
    out_sin, out_cos = out
    square, ds, dc = scratch
    np.multiply(angle, angle, square)
    # sin a = a (1 - a^2/6 (1 - a^2/20 (1 - a^2/42))); 1 - cos a = a^2/2 (1 - a^2/12 (1 - a^2/30 (1 - a^2/56)))
    np.multiply(square, -1.0 / 42.0, ds)
    ds += 1.0
    _nested(ds, square, 20.0)
    _nested(ds, square, 6.0)
    ds *= angle
    np.multiply(square, -1.0 / 56.0, dc)
    dc += 1.0
    _nested(dc, square, 30.0)
    _nested(dc, square, 12.0)
    dc *= square
    dc *= -0.5
    # sin + (sin (cos a - 1) + cos sin a), so that nothing is lost where a is tiny
    np.multiply(sin, dc, out_sin)
    np.multiply(cos, ds, square)
    out_sin += square
    out_sin += sin
    np.multiply(cos, dc, out_cos)
    np.multiply(sin, ds, square)
    out_cos -= square
    out_cos += cos


def _nested(series: Array, square: Array, divisor: float) -> None:
    """``1 - square / divisor * series``, in place."""
    series *= square
    series *= -1.0 / divisor
    series += 1.0


def between(R_to: Array, R_from: Array) -> tuple[Array, Array]:
    """The turn from one rotation to another in their common frame, and ``(N,)`` the trace of its matrix.

    Args:
        R_to, R_from: ``(3, 3, N)`` columns, by rows of poses.

    Returns:
        Meaningless where the trace is not near three; there the turn is not small.
    """
    product, out, scratch = np.empty_like(R_to), np.empty_like(R_to), np.empty_like(R_to)
    # The columns of all three, side by side: twice the sine of the angle times the axis.
    cross(R_from.swapaxes(0, 1), R_to.swapaxes(0, 1), out, scratch)
    np.multiply(R_to, R_from, product)
    trace = np.add.reduce(product.reshape(9, -1), axis=0)
    v = np.add.reduce(out, axis=1)
    scale = np.sqrt(np.maximum(trace + 1.0, 1e-9))  # twice the scalar part
    v *= np.divide(0.5, scale, out=scale)
    return v, trace


def from_rotation_vector(vector: Array) -> Array:
    """Of a small rotation vector ``(3, N)``, rad."""
    square = np.add.reduce(np.square(vector), axis=0)
    series = 1.0 - square / 24.0 * (1.0 - square / 80.0)  # sin(a/2) / (a/2)
    series *= 0.5
    return vector * series


def rotation_vector(v: Array) -> Array:
    """``(3, N)`` rad, of a small turn."""
    square = np.add.reduce(np.square(v), axis=0)
    # 2 asin(s) / s
    series = 2.0 + square * (1.0 / 3.0 + square * (3.0 / 20.0 + square * (5.0 / 56.0 + square * (35.0 / 576.0))))
    return v * series


def scalar_part(v: Array) -> Array:
    """``(N,)`` cosine of half the angle."""
    return np.sqrt(np.maximum(1.0 - np.add.reduce(np.square(v), axis=0), 0.0))


def without(v: Array, first: Array) -> Array:
    """The turn that is left of ``v`` if ``first`` has been done before it: v after the inverse of first."""
    scratch = np.empty_like(v)
    left = cross(first, v, np.empty_like(v), scratch)
    left += v * scalar_part(first)
    left -= first * scalar_part(v)
    return left


def turned_by(v: Array, point: Array) -> Array:
    """``(3, N)`` by how much a turn moves points."""
    scratch = np.empty_like(v)
    once = cross(v, point, np.empty_like(v), scratch)
    moved = cross(v, once, np.empty_like(v), scratch)
    once *= scalar_part(v)
    moved += once
    moved *= 2.0
    return moved
