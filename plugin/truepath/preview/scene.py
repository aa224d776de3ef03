"""The scene in the language of meshcat, recorded instead of sent to a server.

Colours are those of Okabe and Ito, which people with any colour vision can tell apart.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import meshcat.geometry as mg
import numpy as np
import umsgpack
from meshcat.animation import Animation
from meshcat.path import Path as ScenePath
from meshcat.visualizer import Visualizer

from truepath import lie
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.networks_along import NetworksAlong
from truepath.preview.arm import Arm, Rgba
from truepath.preview.geometry import grid_lines, line_segments, rod, tube
from truepath.preview.toolpaths import KeyFrames, Toolpaths, fine_positions, interpolate, thin_out
from truepath.robot import rotation_about_axis

PROGRAMMED, UNCORRECTED, CORRECTED, OUTSIDE, FADED = "#3a3a3a", "#d55e00", "#0072b2", "#e69f00", "#cc79a7"
AXES = ("#c0392b", "#2e8b57", "#2c5fa8")  # x, y, z as everybody draws them
GRID_COLOUR = "#b9c0c8"
SKY, HORIZON = (1.0, 1.0, 1.0), (0.86, 0.89, 0.92)
GHOST_OPACITY = 0.28
GRID_CELL_M = 0.1
MOST_ERROR_LINES = 66
VIEW_POSTURES = 60
VIEW_AZIMUTH_RAD, VIEW_ELEVATION_RAD = np.radians(-55.0), np.radians(24.0)  # azimuth from where the path lies
FAR_WALLS_ONLY = {"side": 1, "depthWrite": False}  # 1: back side, of three.js; what is within shows
SHARED_BYTES = 200  # geometries from this size on are stored once, however often they are used

ROOT = "truepath"
ARM, GHOST, ERROR_LINES = "arm_corrected", "arm_uncorrected", "error_lines"
PATH_PROGRAMMED, PATH_UNCORRECTED, PATH_CORRECTED = "path_programmed", "path_uncorrected", "path_corrected"
PATH_FADED = "path_faded"
BAND, SLEEVE_LEAST, SLEEVE_MOST = 2.8, 4.0, 6.5  # half widths, in those of a line


@dataclass
class RecordedScene:
    """Commands for meshcat's viewer; also the window that meshcat's ``Visualizer`` sends them to.

    Attributes:
        chunks: pieces of packed commands; pieces that are alike are stored once.
        commands: each command as the numbers of the chunks that make it up.
        view_points: ``(K, 3)`` points that the first view must hold, z up, m.
        view_direction: ``(3,)`` from there to the camera.
    """

    chunks: list[bytes] = field(default_factory=list)
    commands: list[list[int]] = field(default_factory=list)
    view_points: Array = field(default_factory=lambda: np.zeros((1, 3)))
    view_direction: Array = field(default_factory=lambda: np.ones(3))
    _number: dict[bytes, int] = field(default_factory=dict)

    def send(self, command: Any) -> None:
        """Takes a meshcat command, as meshcat's own window does."""
        lowered = command.lower()
        packed = _pack(lowered)
        geometries = [_pack(geometry) for geometry in lowered.get("object", {}).get("geometries", [])]
        parts = []
        for geometry in geometries:
            if len(geometry) >= SHARED_BYTES:
                before, geometry, packed = packed.partition(geometry)
                parts += [before, geometry]
        self.commands.append([self._store(part) for part in (*parts, packed)])

    def _store(self, part: bytes) -> int:
        if part not in self._number:
            self._number[part] = len(self.chunks)
            self.chunks.append(part)
        return self._number[part]


def _pack(content: Any) -> bytes:
    return umsgpack.packb(content, force_float_precision="single")


def record_scene(
    arm: Arm,
    model: CalibratedModel,
    q_programmed: Array,
    q_corrected: Array,
    outside: Array,
    frames: KeyFrames,
    magnification: float,
) -> RecordedScene:
    """Everything that is to be seen, in the robot base frame but with the world's up as up.

    Args:
        arm: shapes of the robot.
        model: the calibrated robot.
        q_programmed, q_corrected: ``(N, n)`` joints, rad.
        outside: ``(N,)`` True where a waypoint lies outside the calibrated region.
        frames: the animation.
        magnification: factor by which errors are drawn.
    """
    recorded = RecordedScene()
    scene = _Scene(Visualizer.view_into(recorded, ScenePath((ROOT,))))
    X_up = lie.make_pose(model.robot.X_WB[:3, :3])
    scene.root.set_transform(X_up)

    position = fine_positions(q_programmed)
    q_fine = interpolate(q_programmed, position), interpolate(q_corrected, position)
    paths = Toolpaths.of(model, *q_fine).magnified(magnification)
    postures = np.concatenate([frames.q_corrected, frames.q_uncorrected])
    postures = postures[np.linspace(0, len(postures) - 1, min(len(postures), VIEW_POSTURES)).astype(int)]
    bodies = _occupied_points(arm, postures)
    size = max(float(np.linalg.norm(bodies, axis=1).max()), 0.1)

    scene.surroundings(size)
    if model.residual is not None:  # before the paths: what is transparent is drawn in the order in which it came
        scene.sleeve(paths.goal, NetworksAlong.of(model.residual, q_fine[1]), 0.002 * size)
    scene.paths(paths, outside[np.round(position).astype(int)], 0.002 * size)
    scene.error_lines(Toolpaths.of(model, q_programmed, q_corrected).magnified(magnification))
    solid, ghost = scene.root[ARM], scene.root[GHOST]
    scene.arm(solid, arm, frames.q_corrected[0], size, model.X_FE[:3, 3], CORRECTED)
    scene.arm(ghost, arm, frames.q_uncorrected[0], size, model.X_FE[:3, 3], UNCORRECTED, as_ghost=True)
    if len(frames.time_s) > 1:
        animation = Animation(default_framerate=1)  # times in seconds
        for node, q in ((solid, frames.q_corrected), (ghost, frames.q_uncorrected)):
            _animate(animation, node, arm, frames.time_s, q)
        scene.root.set_animation(animation, play=True, repetitions=1_000_000)

    lines = np.concatenate([paths.goal, paths.uncorrected, paths.corrected])
    lines = lines[np.linspace(0, len(lines) - 1, min(len(lines), 300)).astype(int)]
    recorded.view_points = np.concatenate([bodies, lines]) @ X_up[:3, :3].T
    recorded.view_direction = _view_direction(X_up[:3, :3] @ paths.goal.mean(axis=0))
    return recorded


class _Scene:
    """Puts things into the scene. Identifiers count up, so that equal input makes an equal page."""

    def __init__(self, root: Visualizer) -> None:
        self.root = root
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

    def surroundings(self, size: float) -> None:
        """Background, floor grid and the axes of the base frame, in place of what meshcat shows by itself."""
        window = self.root.window
        for name, key, value in (
            ("Background", "top_color", SKY),
            ("Background", "bottom_color", HORIZON),
            ("Grid", "visible", False),
            ("Axes", "visible", False),
        ):
            Visualizer.view_into(window, ScenePath((name,))).set_property(key, value)
        material = self.material(mg.LineBasicMaterial, _rgb(GRID_COLOUR), opacity=0.6)
        self.put(self.root["floor"], line_segments(*grid_lines(1.1 * size, GRID_CELL_M), material))
        for axis, (name, colour) in enumerate(zip("xyz", AXES, strict=True)):
            geometry, X = rod(np.zeros(3), 0.2 * size * np.eye(3)[axis], 0.003 * size)
            self.put(self.root["base_axes"][name], mg.Mesh(geometry, self.bright(colour)), X)

    def paths(self, paths: Toolpaths, outside: Array, radius: float) -> None:
        """The three lines. The programmed one is a wide pale band, so that the corrected one shows inside it."""
        shades = np.where(outside[:, None], _unit_rgb(OUTSIDE), _unit_rgb(PROGRAMMED))
        band = self.material(mg.MeshBasicMaterial, 0xFFFFFF, vertexColors=True, opacity=0.5, **FAR_WALLS_ONLY)
        self.line(PATH_PROGRAMMED, paths.goal, BAND * radius, band, shades)
        self.line(PATH_UNCORRECTED, paths.uncorrected, radius, self.bright(UNCORRECTED))
        self.line(PATH_CORRECTED, paths.corrected, radius, self.bright(CORRECTED))

    def sleeve(self, points: Array, networks: NetworksAlong, radius: float) -> None:
        """Around the programmed line ``(K, 3)``: the wider, the more the networks are faded there; else none."""
        half_width = SLEEVE_LEAST + (SLEEVE_MOST - SLEEVE_LEAST) * (1.0 - networks.weight)
        if networks.faded.any():
            material = self.material(mg.MeshBasicMaterial, _rgb(FADED), opacity=0.75, **FAR_WALLS_ONLY)
            self.line(PATH_FADED, points, radius * np.where(networks.faded, half_width, 0.0), material)

    def line(
        self, name: str, points: Array, radius: float | Array, material: mg.Material, shades: Array | None = None
    ) -> None:
        """A tube through points ``(K, 3)``, each with its own shade ``(K, 3)`` and radius ``(K,)`` if so wished."""
        kept = thin_out(points)
        geometry = tube(
            points[kept], np.broadcast_to(radius, len(points))[kept], None if shades is None else shades[kept]
        )
        if geometry is not None:  # a path that stays in one point has no line; the arms show it
            self.put(self.root[name], mg.Mesh(geometry, material))

    def bright(self, colour: str) -> mg.Material:
        """A colour that no light changes, so that it is that of the legend."""
        return self.material(mg.MeshBasicMaterial, _rgb(colour))

    def error_lines(self, at_waypoints: Toolpaths) -> None:
        """Thin lines from where the tool should be to where it would be."""
        N = len(at_waypoints.goal)
        shown = np.unique(np.linspace(0, N - 1, min(N, MOST_ERROR_LINES)).astype(int))
        material = self.material(mg.LineBasicMaterial, _rgb(UNCORRECTED), opacity=0.55)
        thing = line_segments(at_waypoints.goal[shown], at_waypoints.uncorrected[shown], material)
        self.put(self.root[ERROR_LINES], thing)

    def arm(
        self, node: Visualizer, arm: Arm, q_rad: Array, size: float, p_FE: Array, colour: str, as_ghost: bool = False
    ) -> None:
        """The arm with a probe that reaches from the flange to the tool point; a ghost has no base."""
        carriers = _carriers(node, len(arm.link_transforms) - 1)
        for carrier, X in zip(carriers[1:], _joint_transforms(arm, q_rad), strict=True):
            carrier.set_transform(X)
        for k, shape in enumerate(arm.shapes):
            if not (as_ghost and shape.carrier == 0):
                material = self._ghostly() if as_ghost else self._painted(shape.rgba)
                self.put(carriers[shape.carrier][f"shape_{k}"], mg.Mesh(shape.geometry, material), shape.X_AS)
        X_AF = arm.link_transforms[-1]
        p_AE = X_AF[:3, :3] @ p_FE + X_AF[:3, 3]
        bright = self.bright(colour)
        self.put(carriers[-1]["tool_point"], mg.Mesh(mg.Sphere(0.009 * size), bright), lie.make_pose(translation=p_AE))
        if np.linalg.norm(p_FE) > 1e-3:
            geometry, X = rod(X_AF[:3, 3], p_AE, 0.003 * size)
            self.put(carriers[-1]["tool"], mg.Mesh(geometry, bright), X)

    def _painted(self, rgba: Rgba) -> mg.Material:
        colour = sum(
            round(255 * min(max(channel, 0.0), 1.0)) << shift for channel, shift in zip(rgba, (16, 8, 0), strict=False)
        )
        return self.material(mg.MeshPhongMaterial, colour, opacity=rgba[3], shininess=40, specular=0x333333)

    def _ghostly(self) -> mg.Material:
        # Pushed back by a hair: where arm and ghost coincide, the arm is seen and nothing flickers.
        behind = {"polygonOffset": True, "polygonOffsetFactor": 2, "polygonOffsetUnits": 2}
        return self.material(mg.MeshPhongMaterial, _rgb(UNCORRECTED), opacity=GHOST_OPACITY, depthWrite=False, **behind)


def _carriers(node: Visualizer, num_joints: int) -> list[Visualizer]:
    """Nodes of base and joints, each within the one before it."""
    nodes = [node]
    for i in range(num_joints):
        nodes.append(nodes[-1][f"joint_{i + 1}"])
    return nodes


def _joint_transforms(arm: Arm, q_rad: Array) -> Array:
    """``(..., n, 4, 4)`` each axis frame in the one before it, for joints ``(..., n)``."""
    return arm.link_transforms[:-1] @ rotation_about_axis(np.eye(4), q_rad.reshape(-1)).reshape(*q_rad.shape, 4, 4)


def _occupied_points(arm: Arm, q_rad: Array) -> Array:
    """``(P, 3)`` corners in B of boxes around the base, the links and the flange for joints ``(K, n)``."""
    X_BA, points = np.broadcast_to(np.eye(4), (len(q_rad), 4, 4)), []
    for carrier, step in enumerate((None, *np.moveaxis(_joint_transforms(arm, q_rad), 1, 0))):
        X_BA = X_BA if step is None else X_BA @ step
        corners = [shape.corners() for shape in arm.shapes if shape.carrier == carrier]
        local = np.concatenate([np.zeros((1, 3)), *corners])
        box = np.stack(np.meshgrid(*np.stack([local.min(axis=0), local.max(axis=0)], axis=1)), axis=-1).reshape(-1, 3)
        points.append((box @ np.swapaxes(X_BA[:, :3, :3], 1, 2) + X_BA[:, None, :3, 3]).reshape(-1, 3))
    return np.concatenate(points)


def _animate(animation: Animation, node: Visualizer, arm: Arm, time_s: Array, q_rad: Array) -> None:
    """Turns the joints: between key frames the viewer interpolates rotations, which for a joint is exact."""
    quaternions = lie.to_quaternion(_joint_transforms(arm, q_rad)[..., :3, :3])
    for carrier, of_joint in zip(_carriers(node, q_rad.shape[1])[1:], np.moveaxis(quaternions, 1, 0), strict=True):
        for time, (w, x, y, z) in zip(time_s.tolist(), of_joint.tolist(), strict=True):
            animation.at_frame(carrier, time).set_property("quaternion", "quaternion", [x, y, z, w])


def _view_direction(path_centre: Array) -> Array:
    """From the side, so that arm and path lie beside each other, and a little from above."""
    azimuth = np.arctan2(path_centre[1], path_centre[0]) + VIEW_AZIMUTH_RAD
    level, up = np.cos(VIEW_ELEVATION_RAD), np.sin(VIEW_ELEVATION_RAD)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), up])


def _rgb(colour: str) -> int:
    return int(colour[1:], 16)


def _unit_rgb(colour: str) -> Array:
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
