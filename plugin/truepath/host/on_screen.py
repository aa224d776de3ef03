"""Text in a Meshcat, which has none of its own: pictures on panes that the camera carries along.

A pane is a rectangle of glTF with its picture as texture, hung below the camera in the scene tree. So it stays where it
is on the screen however the operator turns the view, and every browser that connects sees it.
"""

from __future__ import annotations

import base64
import io
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pydrake.geometry import Mesh, Meshcat

CAMERA = "/Cameras/default/rotated/<object>"
SCREEN_PX = 768  # height of the screen that sizes are meant for; on others everything grows with the height
HALF_VIEW = np.tan(np.radians(37.5))  # of Meshcat's camera, upwards, at distance 1
DISTANCE_M = 0.05  # from the camera: nearer than anything else, farther than where the camera begins to see
MARGIN_PX = 4
SHARPNESS = 1.5  # pixels of the picture for one of the screen, which may be finer than most
DPI = 100
KEPT, BEHIND = 16, 1.002  # pictures in the tree; how much farther the one before is


@dataclass
class Pane:
    """A place for text at the top or the bottom of the screen, in the middle.

    Attributes:
        meshcat: whose.
        name: of the pane, one word.
        width_px, height_px: of a screen that is ``SCREEN_PX`` high. Nobody knows how wide it is: a pane no wider than
            it is high is seen whole on all but upright ones.
        edge: of the screen, at which it is.
        off_px: how far from there: what other panes take.
    """

    meshcat: Meshcat
    name: str
    width_px: int
    height_px: int
    edge: Literal["top", "bottom"]
    off_px: int = 0
    _count: int = field(default=0, init=False)

    @property
    def path(self) -> str:
        """Where it is in the scene tree."""
        return f"{CAMERA}/{self.name}"

    def figure(self) -> Figure:
        """An empty picture of the right size; ``figure.text`` and others take shares of it."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(self.width_px / DPI, self.height_px / DPI), dpi=SHARPNESS * DPI)
        FigureCanvasAgg(figure)
        figure.patch.set_facecolor("white")
        return figure

    def put(self, figure: Figure) -> None:
        """Shows a picture, in place of the one before.

        A browser fetches pictures some time after it was told of them, and a Meshcat drops what is no longer in the
        tree. So the last ones stay there, hidden; and the one before, behind the new one until that has come.
        """
        from pydrake.math import RigidTransform, RollPitchYaw

        picture = io.BytesIO()
        figure.savefig(picture, format="png")
        per_px = 2.0 * HALF_VIEW * DISTANCE_M / SCREEN_PX
        width, height = per_px * self.width_px, per_px * self.height_px
        middle = HALF_VIEW * DISTANCE_M - per_px * (MARGIN_PX + self.off_px) - height / 2.0
        in_view = np.array([0.0, middle if self.edge == "top" else -middle, -DISTANCE_M])
        upright = RollPitchYaw(-np.pi / 2, 0, 0)  # of glTF y is up; Drake turns that into z
        this, before, old = (f"{self.path}/{(self._count - k) % KEPT}" for k in range(3))
        self.meshcat.SetObject(this, _textured(picture.getvalue(), width, height))
        self.meshcat.SetTransform(this, RigidTransform(upright, in_view))
        self.meshcat.SetProperty(this, "visible", True)
        if self._count > 0:
            self.meshcat.SetTransform(before, RigidTransform(upright, BEHIND * in_view))
        if self._count > 1:
            self.meshcat.SetProperty(old, "visible", False)
        self._count += 1

    def remove(self) -> None:
        """Takes it off the screen."""
        self.meshcat.Delete(self.path)


def _textured(png: bytes, width: float, height: float) -> Mesh:
    """A rectangle about the origin with a picture on it, which no light changes."""
    from pydrake.common import MemoryFile
    from pydrake.geometry import InMemoryMesh, Mesh

    signs = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    corners = signs * np.array([width, height, 0.0], np.float32) / 2
    pieces = (corners, np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32), np.array([0, 1, 2, 0, 2, 3], np.uint16))
    lengths = [piece.nbytes for piece in pieces]
    starts = np.cumsum([0, *lengths[:-1]]).tolist()
    content: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "extensionsUsed": ["KHR_materials_unlit"],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0},
                "doubleSided": True,
                "extensions": {"KHR_materials_unlit": {}},
            }
        ],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}],  # linear, not repeated
        "images": [{"uri": _as_uri("image/png", png)}],
        "buffers": [
            {
                "byteLength": sum(lengths),
                "uri": _as_uri("application/octet-stream", b"".join(piece.tobytes() for piece in pieces)),
            }
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": length}
            for start, length in zip(starts, lengths, strict=True)
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,  # float
                "count": 4,
                "type": "VEC3",
                "min": corners.min(axis=0).tolist(),
                "max": corners.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},  # unsigned short
        ],
    }
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(json.dumps(content), ".gltf", "pane")))


def _as_uri(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
