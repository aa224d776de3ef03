"""Things put into a scene of meshcat: lines, arrows, frames, arms."""

from __future__ import annotations

from typing import Any

import meshcat.geometry as mg
import numpy as np
from meshcat.path import Path as ScenePath
from meshcat.visualizer import Visualizer

from truepath import lie
from truepath.lie import Array
from truepath.preview.arm import Arm, Rgba
from truepath.preview.colours import AXES, UNCORRECTED, rgb, unit_rgb
from truepath.preview.geometry import grid_lines, line_segments, rod, triads, tube
from truepath.preview.thinning import LINE_LIMIT, thin_out
from truepath.robot import rotation_about_axis

GRID_COLOUR = "#b9c0c8"
SKY, HORIZON = (1.0, 1.0, 1.0), (0.86, 0.89, 0.92)
GHOST_OPACITY = 0.28
GRID_CELL_M = 0.1
LINE_TOLERANCE = 5e-5  # of the size of the scene
SHADE_WEIGHT = 0.02  # of the size of the scene: what the full change of a colour counts when a line is thinned out
VEIL_OPACITY = 0.3
FAR_WALLS_ONLY = {"side": 1, "depthWrite": False}  # 1: back side, of three.js; what is within shows
PLAIN, BY_ERROR = "plain", "by_error"


class Stage:
    """Puts things into the scene. Identifiers count up, so that equal input makes an equal page.

    Attributes:
        root: node below which all is put.
        size: of the scene, m: lines are as wide as suits it.
    """

    def __init__(self, root: Visualizer, size: float) -> None:
        self.root, self.size = root, size
        self._identifiers: set[str] = set()
        self._materials: dict[tuple, mg.Material] = {}

    def _identify(self, element: Any) -> None:
        if element.uuid not in self._identifiers:
            element.uuid = f"{len(self._identifiers):08x}"
            self._identifiers.add(element.uuid)

    def put(self, node: Visualizer, thing: mg.Object, X: Array | None = None) -> None:
        """An object at a node. A geometry keeps its first identifier, so that it is recognised when it comes again."""
        self._identify(thing)
        self._identify(thing.geometry)
        node.set_object(thing)
        if X is not None:
            node.set_transform(X)

    def material(self, kind: type, colour: int, **options: Any) -> mg.Material:
        key = (kind, colour, tuple(sorted(options.items())))
        if key not in self._materials:
            self._materials[key] = kind(color=colour, **options)
            self._identify(self._materials[key])
        return self._materials[key]

    def bright(self, colour: str) -> mg.Material:
        """A colour that no light changes, so that it is that of the legend."""
        return self.material(mg.MeshBasicMaterial, rgb(colour), side=2)

    def shaded(self, **options: Any) -> mg.Material:
        """The colours of the vertices, which no light changes."""
        return self.material(mg.MeshBasicMaterial, 0xFFFFFF, vertexColors=True, **{"side": 2, **options})

    def surroundings(self, R_WB: Array, grid_m: float) -> None:
        """Background, a level grid and the axes of the base frame, in place of what meshcat shows by itself.

        Args:
            R_WB: ``(3, 3)`` how the base stands in the world.
            grid_m: height of the grid above the base.
        """
        window = self.root.window
        for name, key, value in (
            ("Background", "top_color", SKY),
            ("Background", "bottom_color", HORIZON),
            ("Grid", "visible", False),
            ("Axes", "visible", False),
        ):
            Visualizer.view_into(window, ScenePath((name,))).set_property(key, value)
        material = self.material(mg.LineBasicMaterial, rgb(GRID_COLOUR), opacity=0.6)
        lines = line_segments(*grid_lines(1.1 * self.size, GRID_CELL_M), material)
        self.put(self.root["floor"], lines, lie.make_pose(R_WB.T, grid_m * R_WB[2]))
        self.frames("base_axes", np.eye(4)[None], 0.2 * self.size, 0.003 * self.size)

    def frames(self, name: str, X: Array, length_m: float, radius_m: float) -> None:
        """Frames ``(K, 4, 4)`` as three rods each."""
        colours = np.stack([unit_rgb(colour) for colour in AXES])
        self.put(self.root[name], mg.Mesh(triads(X, length_m, radius_m, colours), self.shaded()))

    def line(
        self,
        name: str,
        points: Array,
        piece: Array,
        radius: float | Array,
        material: mg.Material | None,
        shades: Array | None = None,
    ) -> None:
        """A tube through points ``(K, 3)`` of pieces ``(K,)``, each with its own radius ``(K,)`` and shade ``(K, 3)``.

        Args:
            material: None: the shades are colours by error, and there is a second look, in the colour of what is
                not corrected.
        """
        radius = np.broadcast_to(radius, len(points))
        seen = [points, radius[:, None], self.size * piece[:, None]]
        if shades is not None:
            seen.append(SHADE_WEIGHT * self.size * shades)
        kept = thin_out(np.concatenate(seen, axis=1), LINE_LIMIT, LINE_TOLERANCE * self.size)
        colours = None if shades is None else shades[kept]
        geometry = tube(points[kept], radius[kept], colours, piece[kept])
        if geometry is None:  # a path that stays in one point has no line; the arms show it
            return
        if material is None:
            self.two_looks(name, geometry)
        else:
            self.put(self.root[name], mg.Mesh(geometry, material))

    def two_looks(self, name: str, geometry: mg.TriangularMeshGeometry) -> None:
        """The same in one colour and in colours by error, of which the page shows one."""
        self.put(self.root[name][PLAIN], mg.Mesh(geometry, self.bright(UNCORRECTED)))
        self.put(self.root[name][BY_ERROR], mg.Mesh(geometry, self.shaded()))

    def veil(self, name: str, vertices: Array, faces: Array, colour: str) -> None:
        """A surface that can be seen through."""
        see_through = {"opacity": VEIL_OPACITY, **FAR_WALLS_ONLY}
        material = self.material(mg.MeshLambertMaterial, rgb(colour), **see_through)
        self.put(self.root[name], mg.Mesh(mg.TriangularMeshGeometry(vertices, faces), material))

    def arm(self, node: Visualizer, arm: Arm, q_rad: Array, p_FT: Array, colour: str, as_ghost: bool = False) -> None:
        """The arm with a probe that reaches from the flange to the tool point; a ghost has no base."""
        carriers = [node]
        for i, X in enumerate(joint_transforms(arm, q_rad)):
            carriers.append(carriers[-1][joint_node(i)])
            carriers[-1].set_transform(X)
        for k, shape in enumerate(arm.shapes):
            if not (as_ghost and shape.carrier == 0):
                material = self._ghostly() if as_ghost else self._painted(shape.rgba)
                self.put(carriers[shape.carrier][f"shape_{k}"], mg.Mesh(shape.geometry, material), shape.X_AS)
        X_AF = arm.link_transforms[-1]
        p_AT = X_AF[:3, :3] @ p_FT + X_AF[:3, 3]
        bright, ball = self.bright(colour), mg.Sphere(0.009 * self.size)
        self.put(carriers[-1]["tool_point"], mg.Mesh(ball, bright), lie.make_pose(translation=p_AT))
        if np.linalg.norm(p_FT) > 1e-3:
            geometry, X = rod(X_AF[:3, 3], p_AT, 0.003 * self.size)
            self.put(carriers[-1]["tool"], mg.Mesh(geometry, bright), X)

    def _painted(self, rgba: Rgba) -> mg.Material:
        colour = sum(
            round(255 * min(max(channel, 0.0), 1.0)) << shift for channel, shift in zip(rgba, (16, 8, 0), strict=False)
        )
        return self.material(mg.MeshPhongMaterial, colour, opacity=rgba[3], shininess=40, specular=0x333333)

    def _ghostly(self) -> mg.Material:
        # Pushed back by a hair: where arm and ghost coincide, the arm is seen and nothing flickers.
        behind = {"polygonOffset": True, "polygonOffsetFactor": 2, "polygonOffsetUnits": 2}
        return self.material(
            mg.MeshLambertMaterial, rgb(UNCORRECTED), opacity=GHOST_OPACITY, depthWrite=False, **behind
        )


def joint_node(index: int) -> str:
    """Name of the node that turns with a joint, counted from 0; each is within the one before it."""
    return f"joint_{index + 1}"


def joint_transforms(arm: Arm, q_rad: Array) -> Array:
    """``(..., n, 4, 4)`` each axis frame in the one before it, for joints ``(..., n)``."""
    return arm.link_transforms[:-1] @ rotation_about_axis(np.eye(4), q_rad.reshape(-1)).reshape(*q_rad.shape, 4, 4)


def occupied_points(arm: Arm, q_rad: Array) -> Array:
    """``(P, 3)`` corners in B of boxes around the base, the links and the flange for joints ``(K, n)``."""
    X_BA, points = np.broadcast_to(np.eye(4), (len(q_rad), 4, 4)), []
    for carrier, step in enumerate((None, *np.moveaxis(joint_transforms(arm, q_rad), 1, 0))):
        X_BA = X_BA if step is None else X_BA @ step
        corners = [shape.corners() for shape in arm.shapes if shape.carrier == carrier]
        local = np.concatenate([np.zeros((1, 3)), *corners])
        box = np.stack(np.meshgrid(*np.stack([local.min(axis=0), local.max(axis=0)], axis=1)), axis=-1).reshape(-1, 3)
        points.append((box @ np.swapaxes(X_BA[:, :3, :3], 1, 2) + X_BA[:, None, :3, 3]).reshape(-1, 3))
    return np.concatenate(points)
