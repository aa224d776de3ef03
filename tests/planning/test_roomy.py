"""A margin kept by growing shapes: how far they grow, by hand; what it comes to in a cell, by Drake's own distances."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.geometry import Box, Capsule, Convex, Cylinder, Ellipsoid, Sphere
from truepath.clearance import Cell
from truepath.model import nominal_model
from truepath.planning.free_space import FreeSpace
from truepath.planning.roomy import RoomyCell, grown
from truepath.plants import load_robot

BY_M = 0.01
U = np.random.default_rng(0).normal(size=(500, 3))
U /= np.linalg.norm(U, axis=1, keepdims=True)
CORNERS = np.array([[0.1, 0, 0], [-0.05, 0.1, 0], [-0.05, -0.1, 0], [0, 0, 0.2]])
UPRIGHT = np.array([0, -np.pi / 2, 0, -np.pi / 2, 0, 0])
WRIST_IN_FOREARM = np.array([0, -1.57, 0, 1.79, 0.35, -1.72])  # nothing else touches: found by Drake


def extent(shape):
    """``(500,)`` how far a shape reaches in the directions U."""
    if isinstance(shape, Sphere):
        return np.full(len(U), shape.radius())
    if isinstance(shape, Box):
        return np.abs(U) @ shape.size() / 2
    if isinstance(shape, Cylinder):
        return shape.radius() * np.hypot(U[:, 0], U[:, 1]) + shape.length() / 2 * np.abs(U[:, 2])
    if isinstance(shape, Capsule):
        return shape.radius() + shape.length() / 2 * np.abs(U[:, 2])
    if isinstance(shape, Ellipsoid):
        return np.linalg.norm(U * [shape.a(), shape.b(), shape.c()], axis=1)
    hull = shape.GetConvexHull()
    return np.max([U @ hull.vertex(k) for k in range(hull.num_vertices())], axis=0)


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.1),
        Box(0.1, 0.2, 0.3),
        Cylinder(0.05, 0.3),
        Capsule(0.05, 0.3),
        Ellipsoid(0.1, 0.08, 0.12),
        Convex(points=CORNERS.T, label="tetrahedron"),
    ],
    ids=lambda shape: type(shape).__name__,
)
def test_a_grown_shape_holds_all_that_is_no_further_from_the_shape_and_little_else(shape):
    hull = shape.GetConvexHull() if isinstance(shape, Convex) else None
    inspector = SimpleNamespace(GetShape=lambda _: shape, GetConvexHull=lambda _: hull)
    more = extent(grown(inspector, None, BY_M)) - extent(shape)
    assert more.min() > BY_M - 1e-9
    assert more.max() < np.sqrt(3) * BY_M + 1e-9


def test_neighbours_in_the_chain_need_no_margin_but_may_not_touch(anywhere):
    assert ("ur5::forearm_link", "ur5::wrist_2_link") in anywhere.space.cell.neighbours
    free = anywhere.space.are_free(np.stack([UPRIGHT, WRIST_IN_FOREARM]))
    np.testing.assert_array_equal(free, [True, False])


def test_a_margin_is_kept_from_a_mesh_too(tmp_path):
    """Judged by Drake's distances in an unchanged cell; what is refused is within the margin, or nearly so."""
    corners = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (0.0, 0.3)]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    lines = [*(f"v {x} {y} {z}" for x, y, z in corners), *(f"f {face}" for face in faces)]
    (tmp_path / "crate.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "crate.urdf").write_text(
        '<robot name="crate"><link name="crate"><collision><geometry><mesh filename="crate.obj"/></geometry>'
        "</collision></link></robot>"
    )
    cell = tmp_path / "cell.dmd.yaml"
    cell.write_text(
        f"""directives:
- add_directives: {{file: "package://truepath_models/ur5/cell.dmd.yaml"}}
- add_model: {{name: crate, file: "file://{tmp_path}/crate.urdf"}}
- add_weld: {{parent: world, child: crate::crate, X_PC: {{translation: [0, 0.5, 0.8]}}}}
"""
    )
    model, margin_m = nominal_model(load_robot("ur5_cell")), 0.1
    q = np.random.default_rng(0).uniform([0.5, -2.5, -2.5, -3, -3, -3], [2.5, -0.5, 2.5, 3, 3, 3], (150, 6))
    space = FreeSpace(cell, model, margin_m)
    neighbours = RoomyCell(cell, model, margin_m).neighbours
    near = Cell(cell, model).clearances(q, 0.3)
    asked = [k for k, pair in enumerate(near.bodies) if pair not in neighbours]
    distance = near.by_pair_m[:, asked].min(axis=1)
    touching = near.distance_m <= 0
    to_the_crate = near.by_pair_m[:, [k for k in asked if "crate::crate" in near.bodies[k]]].min(axis=1)
    free = space.are_free(q)
    assert (distance[free] > margin_m).all()
    assert free[(distance > np.sqrt(3) * margin_m) & ~touching].all()
    assert (to_the_crate[free] < 0.3).any()
    assert (~free & (to_the_crate == distance) & ~touching).any()  # it was the crate that was near
