"""The shapes of the robot arm, from a URDF: primitives as they are, meshes as triangles.

The URDF supplies shapes only. Where the axes are is what the calibration's nominal robot says; the two are
laid over each other by their axes, which also finds a model that is not the calibrated robot.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshcat.geometry as mg
import numpy as np
import trimesh
import yourdfpy

from truepath import lie, poe
from truepath.errors import InputError
from truepath.lie import Array
from truepath.model_files import find_urdf, mesh_file
from truepath.preview.geometry import Y_TO_Z, rod
from truepath.robot import NominalRobot

SAME_ROBOT_M = 1e-4
DEFAULT_RGBA = (0.78, 0.79, 0.81, 1.0)
BONE_RADIUS_SHARE = 0.025  # of the arm's length
CREASE_RAD = np.radians(30.0)  # edges sharper than this stay sharp
MOST_FACES_TO_SMOOTH = 200_000

Rgba = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Shape:
    """A body that moves with one joint.

    Attributes:
        carrier: 0 for the base, i for what moves with joint i and not with joint i + 1.
        X_AS: ``(4, 4)`` pose in the frame of the carrier: the base frame B, or axis frame Ai, whose z is joint i.
        geometry: of meshcat; shapes that are alike share one.
        rgba: colour, from 0 to 1.
    """

    carrier: int
    X_AS: Array
    geometry: mg.Geometry
    rgba: Rgba

    def corners(self) -> Array:
        """``(8, 3)`` corners of a box around the shape, in the frame of the carrier."""
        lower, upper = _bounds(self.geometry)
        signs = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(8, 3)
        return (lower + signs * (upper - lower)) @ self.X_AS[:3, :3].T + self.X_AS[:3, 3]


@dataclass(frozen=True, eq=False)
class Arm:
    """The nominal arm as it is drawn.

    Attributes:
        link_transforms: ``(n + 1, 4, 4)`` each axis frame in the one before it at zero; the last is the flange.
        shapes: all bodies.
        missing_meshes: names of mesh files that could not be read.
    """

    link_transforms: Array
    shapes: tuple[Shape, ...]
    missing_meshes: tuple[str, ...]


def read_arm(source: str | Path, robot: NominalRobot, robot_name: str) -> Arm:
    """The shapes of a robot.

    Args:
        source: built-in name, URDF or Drake directives.
        robot: nominal robot of the calibration.
        robot_name: its model instance, which decides between several arms of a cell.

    Raises:
        InputError: the file cannot be read, or its arm is not this robot.
    """
    path = find_urdf(source, robot.joint_names, robot_name)
    try:
        urdf = yourdfpy.URDF.load(str(path), load_meshes=False)
    except Exception as error:  # yourdfpy passes on whatever its parsers raise
        raise InputError("the URDF cannot be read", file=path, found=f"{type(error).__name__}: {error}") from error
    X_BR = _place_by_axes(urdf, robot, path)
    X_BA = np.concatenate([np.eye(4)[None], robot.X_BA])
    carriers = _carriers(urdf, robot.joint_names)
    loader = _ShapeLoader(path, {material.name: material for material in urdf.robot.materials})
    shapes = [
        Shape(carriers[link.name], lie.invert(X_BA[carriers[link.name]]) @ X_BR @ X_RS, geometry, rgba)
        for link in urdf.robot.links
        for X_RS, geometry, rgba in loader.load(urdf.get_transform(link.name), link.visuals)
    ]
    link_transforms = poe.link_transforms(robot.X_BA, robot.X_BF)
    if not any(shape.carrier > 0 for shape in shapes):
        shapes += _bones(link_transforms)
    return Arm(link_transforms, tuple(shapes), tuple(dict.fromkeys(loader.missing)))


def _place_by_axes(urdf: yourdfpy.URDF, robot: NominalRobot, path: Path) -> Array:
    """Pose X_BR ``(4, 4)`` of the URDF's root in the base frame, from where both have the joint axes at zero."""
    children = [urdf.joint_map[name] for name in robot.joint_names]
    X_RJ = np.stack([urdf.get_transform(joint.child) for joint in children])
    axes = np.stack(
        [X[:3, :3] @ (joint.axis / np.linalg.norm(joint.axis)) for X, joint in zip(X_RJ, children, strict=True)]
    )
    in_urdf = np.concatenate([X_RJ[:, :3, 3], X_RJ[:, :3, 3] + axes])
    in_base = np.concatenate([robot.X_BA[:, :3, 3], robot.X_BA[:, :3, 3] + robot.X_BA[:, :3, 2]])
    centre_R, centre_B = in_urdf.mean(axis=0), in_base.mean(axis=0)
    R_BR = lie.nearest_rotation((in_base - centre_B).T @ (in_urdf - centre_R))
    X_BR = lie.make_pose(R_BR, centre_B - R_BR @ centre_R)
    distance = np.linalg.norm(in_urdf @ R_BR.T + X_BR[:3, 3] - in_base, axis=1).max()
    if distance > SAME_ROBOT_M:
        raise InputError(
            "the model is not the robot of the calibration",
            file=path,
            expected=f"the joint axes of {robot.name}",
            found=f"axes up to {1e3 * distance:.3g} mm away from them",
        )
    return X_BR


def _carriers(urdf: yourdfpy.URDF, joint_names: tuple[str, ...]) -> dict[str, int]:
    """For each link the number of the last arm joint between the root and it; 0 if there is none."""
    number = {name: i + 1 for i, name in enumerate(joint_names)}
    towards_root = {joint.child: joint for joint in urdf.robot.joints}

    def carrier(link: str) -> int:
        while (joint := towards_root.get(link)) is not None:
            if joint.name in number:
                return number[joint.name]
            link = joint.parent
        return 0

    return {link.name: carrier(link.name) for link in urdf.robot.links}


def _bones(link_transforms: Array) -> list[Shape]:
    """Rods from joint to joint, for a robot without any shape."""
    offsets = link_transforms[1:, :3, 3]
    lengths = np.linalg.norm(offsets, axis=1)
    radius = BONE_RADIUS_SHARE * float(lengths.sum())
    bones = []
    for i, (offset, length) in enumerate(zip(offsets, lengths, strict=True)):
        bones.append(Shape(i + 1, np.eye(4), mg.Sphere(1.3 * radius), DEFAULT_RGBA))
        if length > radius:
            geometry, X = rod(np.zeros(3), offset, radius)
            bones.append(Shape(i + 1, X, geometry, DEFAULT_RGBA))
    return bones


class _ShapeLoader:
    """Turns the visuals of a URDF into geometries; each distinct geometry is made once."""

    def __init__(self, urdf: Path, materials: dict[str, Any]) -> None:
        self.urdf, self.materials = urdf, materials
        self.missing: list[str] = []
        self._known: dict[tuple, list[tuple[mg.Geometry, Rgba | None]]] = {}

    def load(self, X_RL: Array, visuals: list[Any]) -> Iterator[tuple[Array, mg.Geometry, Rgba]]:
        """Pose in the root, geometry and colour of all that one link shows."""
        for visual in visuals:
            X_RS = X_RL if visual.origin is None else X_RL @ visual.origin
            named = self._colour(visual.material)
            for geometry, own in self._geometries(visual.geometry):
                upright = X_RS @ Y_TO_Z if isinstance(geometry, mg.Cylinder) else X_RS
                yield upright, geometry, named or own or DEFAULT_RGBA

    def _colour(self, material: Any) -> Rgba | None:
        if material is not None and material.color is None:
            material = self.materials.get(material.name)
        if material is None or material.color is None:
            return None
        r, g, b, a = (float(v) for v in material.color.rgba)
        return r, g, b, a

    def _geometries(self, shape: Any) -> list[tuple[mg.Geometry, Rgba | None]]:
        key: tuple
        if shape.box is not None:
            key = ("box", *map(float, shape.box.size))
        elif shape.cylinder is not None:
            key = ("cylinder", float(shape.cylinder.length), float(shape.cylinder.radius))
        elif shape.sphere is not None:
            key = ("sphere", float(shape.sphere.radius))
        elif shape.mesh is not None:
            scale = np.broadcast_to(1.0 if shape.mesh.scale is None else shape.mesh.scale, 3)
            key = ("mesh", shape.mesh.filename, *map(float, scale))
        else:
            return []
        if key not in self._known:
            kind, *values = key
            primitives = {"box": lambda *size: mg.Box(size), "cylinder": mg.Cylinder, "sphere": mg.Sphere}
            self._known[key] = (
                self._read_mesh(values[0], np.array(values[1:]))
                if kind == "mesh"
                else [(primitives[kind](*values), None)]
            )
        return self._known[key]

    def _read_mesh(self, name: str, scale: Array) -> list[tuple[mg.Geometry, Rgba | None]]:
        file = mesh_file(name, self.urdf)
        try:
            parts = trimesh.load_scene(file).dump() if file is not None else []
        except Exception:  # whatever the importer of this format raises: the arm is drawn without this mesh
            parts = []
        meshes = [part for part in parts if isinstance(part, trimesh.Trimesh) and len(part.faces)]
        if not meshes:
            self.missing.append(name)
        return [(_triangles(mesh, scale), _mesh_colour(mesh)) for mesh in meshes]


def _bounds(geometry: mg.Geometry) -> tuple[Array, Array]:
    """Lowest and highest coordinates ``(3,)`` of a geometry in its own frame."""
    if isinstance(geometry, mg.TriangularMeshGeometry):
        return geometry.vertices.min(axis=0), geometry.vertices.max(axis=0)
    if isinstance(geometry, mg.Box):
        half = np.array(geometry.lengths) / 2
    elif isinstance(geometry, mg.Cylinder):
        half = np.array([geometry.radiusTop, geometry.height / 2, geometry.radiusTop])
    else:
        half = np.full(3, geometry.radius)
    return -half, half


def _triangles(mesh: trimesh.Trimesh, scale: Array) -> mg.TriangularMeshGeometry:
    if len(mesh.faces) <= MOST_FACES_TO_SMOOTH:
        mesh = trimesh.graph.smooth_shade(mesh, angle=CREASE_RAD)
    return mg.TriangularMeshGeometry(mesh.vertices * scale, mesh.faces)


def _mesh_colour(mesh: trimesh.Trimesh) -> Rgba | None:
    material = getattr(mesh.visual, "material", None)
    colour = getattr(material, "main_color", None)
    if colour is None and getattr(mesh.visual, "defined", False):
        colour = getattr(mesh.visual, "main_color", None)
    if colour is None:
        return None
    r, g, b, a = (float(channel) / 255 for channel in colour)
    return r, g, b, a
