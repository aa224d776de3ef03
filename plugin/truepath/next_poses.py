"""Poses to measure next: those that would separate what the data so far cannot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from truepath.lie import Array
from truepath.robot import NominalRobot

if TYPE_CHECKING:
    from pydrake.geometry import QueryObject

CANDIDATES = 300
POSES = 40
MARGIN_RAD = np.radians(3.0)  # from the joint limits
MOST_TRIES = 40  # per candidate
LEAST_HEIGHT_M = 0.05  # of the flange above the floor of the cell


class Cell:
    """Whether a pose is free of collision, asked of the robot's model in Drake.

    Args:
        spec: built-in name, URDF or directives, as for ``plants.load_robot``.
    """

    def __init__(self, spec: str | Path) -> None:
        from pydrake.systems.framework import DiagramBuilder

        from truepath import plants
        from truepath.arm import locate_arm

        builder = DiagramBuilder()
        self._plant, self._scene_graph = plants.add_cell(builder, plants.cell_of(spec))
        # A context belongs to its diagram; both must live as long as this.
        self._diagram = builder.Build()
        self._root = self._diagram.CreateDefaultContext()
        self._context = self._plant.GetMyMutableContextFromRoot(self._root)
        self._joints = locate_arm(self._plant).joints

    def is_free(self, q_rad: Array) -> bool:
        """Whether the arm at joints ``(n,)`` touches neither itself nor the cell."""
        for joint, angle in zip(self._joints, q_rad, strict=True):
            joint.set_angle(self._context, angle)
        query: QueryObject = self._plant.get_geometry_query_input_port().Eval(self._context)
        return not query.HasCollisions()


def candidates(robot: NominalRobot, spec: str | Path | None, lower_rad: Array, upper_rad: Array) -> Array:
    """``(k, n)`` random joints within the stated range and the limits, free of collision where the cell is known.

    The flange stays above the floor of the robot's base, pointing anywhere.
    """
    from truepath.model import nominal_flange_poses

    rng = np.random.default_rng(0)
    lower = np.maximum(lower_rad, np.maximum(robot.lower_rad, -np.pi) + MARGIN_RAD)
    upper = np.minimum(upper_rad, np.minimum(robot.upper_rad, np.pi) - MARGIN_RAD)
    drawn = rng.uniform(lower, np.maximum(upper, lower), (CANDIDATES * MOST_TRIES, robot.num_joints))
    height = (robot.X_WB @ nominal_flange_poses(robot, drawn))[:, 2, 3] - robot.X_WB[2, 3]
    drawn = drawn[height > LEAST_HEIGHT_M]
    if spec is None:
        return drawn[:CANDIDATES]
    cell, free = Cell(spec), []
    for q in drawn:  # Drake answers one pose at a time
        if cell.is_free(q):
            free.append(q)
            if len(free) == CANDIDATES:
                break
    return np.array(free).reshape(-1, robot.num_joints)


def most_telling(
    columns: Callable[[Array], Array], covariance: Array, q_candidates: Array, count: int = POSES
) -> Array:
    """``(count, n)`` candidates that shrink the uncertainty most, one after the other (D-optimal, greedy).

    Args:
        columns: joints ``(k, n)`` to derivatives ``(k, m, K)`` of the readings, in units of their noise.
        covariance: ``(K, K)`` of the parameters, from the data so far.
        q_candidates: ``(k, n)``.
        count: how many.
    """
    X = columns(q_candidates)
    scale = np.sqrt(np.diag(covariance))
    X, C = X * scale, covariance / np.outer(scale, scale)
    left = np.ones(len(X), bool)
    picked: list[int] = []
    for _ in range(min(count, len(X))):
        XC = X @ C
        S = np.eye(X.shape[1]) + XC @ np.swapaxes(X, 1, 2)
        gain = np.where(left, np.linalg.slogdet(S)[1], -np.inf)
        best = int(np.argmax(gain))
        picked.append(best)
        left[best] = False
        C = C - XC[best].T @ np.linalg.solve(S[best], XC[best])
    return q_candidates[picked]


def to_csv(q_rad: Array) -> str:
    """Joints as CSV, in an order that has nothing to do with the poses."""
    header = ",".join(f"q{i + 1}_rad" for i in range(q_rad.shape[1]))
    rows = np.random.default_rng(0).permutation(len(q_rad))
    return "\n".join([header, *(",".join(f"{angle:.9f}" for angle in q_rad[row]) for row in rows)]) + "\n"
