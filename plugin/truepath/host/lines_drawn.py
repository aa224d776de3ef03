"""Lines in a host's Meshcat that can be seen: WebGL draws every line one pixel wide, so these are tubes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from truepath.lie import Array
from truepath.preview.colours import AXES, unit_rgb
from truepath.preview.geometry import arrows, triads, tube

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

ROD_SHARE = 0.045


def draw_line(
    meshcat: Meshcat,
    path: str,
    points: Array,
    radius_m: float,
    colours: Array,
    piece: Array | None = None,
    *,
    far_walls_only: bool = False,
) -> bool:
    """A line, in place of what was there; False where it would be so short that there is none.

    Args:
        points: ``(K, 3)`` in the world, m.
        colours: ``(K, 3)`` or ``(3,)`` red, green, blue from 0 to 1.
        piece: ``(K,)`` number of the piece that each point belongs to; between pieces there is no line.
        far_walls_only: so that what is within can be seen.
    """
    colours = np.broadcast_to(colours, points.shape)
    return _put(meshcat, path, tube(points, radius_m, colours, piece), far_walls_only)


def draw_arrows(meshcat: Meshcat, path: str, starts: Array, ends: Array, radius_m: float, colour: Array) -> None:
    """Arrows between points ``(K, 3)`` in the world, in place of what was there."""
    _put(meshcat, path, arrows(starts, ends, radius_m, np.broadcast_to(colour, starts.shape)))


def draw_frames(meshcat: Meshcat, path: str, X_WT: Array, length_m: float) -> None:
    """Axes x, y, z of frames ``(K, 4, 4)`` in the world, red, green, blue."""
    _put(meshcat, path, triads(X_WT, length_m, ROD_SHARE * length_m, np.stack([unit_rgb(colour) for colour in AXES])))


def show_through(meshcat: Meshcat, path: str, opacity: float) -> None:
    """Has a line drawn pale and over everything, also where something is before it."""
    meshcat.SetProperty(f"{path}/<object>", "opacity", opacity)
    meshcat.SetProperty(f"{path}/<object>", "material.depthTest", False)


def _put(meshcat: Meshcat, path: str, triangles: Any, far_walls_only: bool = False) -> bool:
    """A geometry of meshcat with colours at its vertices; None: there is nothing to see."""
    if triangles is None:
        meshcat.Delete(path)
        return False
    side = type(meshcat).SideOfFaceToRender
    meshcat.SetTriangleColorMesh(
        path,
        np.asfortranarray(triangles.vertices.T, float),
        np.asfortranarray(triangles.faces.T, np.int32),
        np.asfortranarray(_linear(triangles.color).T, float),
        side=side.kBackSide if far_walls_only else side.kDoubleSide,
    )
    return True


def _linear(colours: Array) -> Array:
    """Brightness as light adds up, as the viewer expects it at vertices, out of sRGB (IEC 61966-2-1)."""
    return np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
