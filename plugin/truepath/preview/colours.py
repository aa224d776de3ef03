"""Colours of the preview, which people with any colour vision can tell apart, and the scale of errors.

The named ones are those of Okabe and Ito; the axes have those of Paul Tol's "vibrant" scheme, because pure red and
green are one colour to many. The scale is the darker part of matplotlib's plasma: brightness alone orders it, and even
its end stands out on a white background.
"""

from __future__ import annotations

import numpy as np

from truepath.lie import Array

PROGRAMMED, UNCORRECTED, CORRECTED, OUTSIDE, FADED = "#3a3a3a", "#d55e00", "#0072b2", "#e69f00", "#cc79a7"
REGION = "#009e73"
BAND_OPACITY = 0.5  # of the programmed path: the corrected one is seen in it
AXES = ("#cc3311", "#009988", "#0077bb")  # x, y, z: red, green, blue as everybody draws them
ERROR_SCALE = ("#0d0887", "#41049d", "#6a00a8", "#8f0da4", "#b12a90", "#cc4778", "#e16462", "#f2844b")  # even steps
NICE_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
LEAST_SCALE_MM = 1e-3


def rgb(colour: str) -> int:
    """As one number, which meshcat wants."""
    return int(colour[1:], 16)


def unit_rgb(colour: str) -> Array:
    """``(3,)`` red, green, blue from 0 to 1."""
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255


def on_white(colour: str, opacity: float) -> str:
    """What a colour is that white shines through."""
    return "#" + "".join(f"{round(255 * (1 - opacity * (1 - channel))):02x}" for channel in unit_rgb(colour))


def error_colours(error_mm: Array, largest_mm: float) -> Array:
    """``(K, 3)`` red, green, blue from 0 to 1 of errors ``(K,)`` on a scale from 0 to the largest."""
    steps = np.stack([unit_rgb(colour) for colour in ERROR_SCALE])
    place = np.clip(np.asarray(error_mm, float) / max(largest_mm, LEAST_SCALE_MM), 0.0, 1.0) * (len(steps) - 1)
    return np.stack([np.interp(place, np.arange(len(steps)), channel) for channel in steps.T], axis=1)


def scale_end_mm(error_mm: Array) -> float:
    """A round number of mm, at or above the largest of the errors ``(K,)``, for the end of the scale."""
    largest = max(float(np.max(error_mm, initial=0.0)), LEAST_SCALE_MM)
    power = 10.0 ** np.floor(np.log10(largest))
    return float(next(step * power for step in NICE_STEPS if step * power >= largest * (1 - 1e-9)))
