"""The example programs keep limits, stay clear of singularities and collide with nothing."""

import csv
from pathlib import Path

import numpy as np
import pytest
from drawn_cell import HOME, MODELS, ROBOTS, Cell
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform


@pytest.fixture(scope="module", params=ROBOTS)
def cell(request) -> Cell:
    return Cell(request.param)


@pytest.fixture(scope="module")
def ur5_cell() -> Cell:
    return Cell("ur5")


@pytest.fixture(params=ROBOTS)
def robot(request) -> str:
    return request.param


def read_columns(path: Path, columns: list[str]) -> tuple[list[str], np.ndarray]:
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        assert reader.fieldnames == ["label", *columns]
        rows = list(reader)
    return [row["label"] for row in rows], np.array([[float(row[column]) for column in columns] for row in rows])


def read_weld_path(robot: str) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Labels, joints in rad, speeds in mm/s."""
    columns = [f"q{i}_rad" for i in range(1, 7)] + ["speed_mm_s"]
    labels, values = read_columns(MODELS / robot / "weld_path.csv", columns)
    return labels, values[:, :6], values[:, 6]


def between(waypoints: np.ndarray, steps: int) -> np.ndarray:
    """The waypoints and the joint-space motion between them."""
    fractions = np.arange(steps) / steps
    legs = waypoints[:-1, None] + fractions[:, None] * np.diff(waypoints, axis=0)[:, None]
    return np.vstack([legs.reshape(-1, waypoints.shape[1]), waypoints[-1:]])


def test_weld_path_has_unique_labels_and_positive_speeds(robot):
    labels, joints, speeds = read_weld_path(robot)
    assert 110 <= len(joints) <= 140
    assert len(set(labels)) == len(labels)
    assert np.all((speeds > 0) & (speeds <= 250))


def test_weld_path_keeps_limits_and_one_branch(cell):
    _, joints, _ = read_weld_path(cell.robot)
    assert np.all(joints < cell.plant.GetPositionUpperLimits())
    assert np.all(joints > cell.plant.GetPositionLowerLimits())
    assert np.abs(np.diff(joints, axis=0)).max() < 0.1
    assert np.all(np.sin(joints[:, 2]) > 0.5)  # elbow: neither stretched nor switched
    assert np.all(np.sin(joints[:, 4]) < -0.5)  # wrist: likewise


def test_weld_path_stays_away_from_singularities(cell):
    _, joints, _ = read_weld_path(cell.robot)
    smallest = [np.linalg.svd(cell.flange_jacobian(q), compute_uv=False)[-1] for q in joints]
    assert min(smallest) > 0.1


def test_weld_path_collides_with_nothing(cell):
    _, joints, _ = read_weld_path(cell.robot)
    for q in between(joints, steps=3):
        assert cell.collisions(q) == set(), q


def test_weld_path_follows_the_plate_3_mm_above_it(cell):
    labels, joints, _ = read_weld_path(cell.robot)
    weld = [q for label, q in zip(labels, joints, strict=True) if label.startswith(("rectangle", "raster"))]
    assert len(weld) > 90
    for q in weld:
        x, y, z = cell.pose("tool_tip", q, relative_to="workpiece").translation()
        assert z == pytest.approx(0.003, abs=1e-6)
        assert abs(x) < 0.125
        assert abs(y) < 0.2


def test_pose_path_is_smooth_reachable_and_free(ur5_cell):
    columns = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    labels, values = read_columns(MODELS / "ur5" / "pose_path.csv", columns)
    positions, quaternions = values[:, :3] / 1000, values[:, 3:]
    assert len(labels) == len(set(labels)) == 60
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1, atol=1e-9)
    # Neighbours share the sign of the quaternion, so it may be interpolated as it is.
    assert np.all(np.sum(quaternions[1:] * quaternions[:-1], axis=1) > 0.99)

    q = HOME
    for k, (position, wxyz) in enumerate(zip(positions, quaternions, strict=True)):
        solution = follow(ur5_cell, RigidTransform(Quaternion(wxyz), position), q)
        if k > 0:
            assert np.abs(solution - q).max() < 0.1
        assert ur5_cell.collisions(solution) == set()
        q = solution


def follow(cell: Cell, target: RigidTransform, q: np.ndarray) -> np.ndarray:
    """Joint values for a flange pose in base_link, by Newton from a neighbour."""
    for _ in range(50):
        pose = cell.pose("flange", q, relative_to="base_link")
        turn = (target.rotation() @ pose.rotation().inverse()).ToAngleAxis()
        shift = target.translation() - pose.translation()
        error = np.r_[turn.angle() * turn.axis(), shift]
        if np.abs(error).max() < 1e-9:
            return q
        q = q + np.linalg.solve(cell.flange_jacobian(q), error)
    raise AssertionError(f"not reached: {target}")
