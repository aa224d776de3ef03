"""What the controller believes its arm to be: the nominal robot, every number of it computed by Drake.

Frames: C the controller's base, 0 its tool flange, T tool. A pose as the protocols write it is six numbers: position in
m and rotation vector in rad.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from truepath import plants
from truepath.arm import locate_arm
from truepath.errors import InputError
from truepath.lie import Array

CLOSE_M, CLOSE_RAD = 1e-9, 1e-9
MOST_STEPS, MOST_STARTS = 60, 24
LARGEST_STEP_RAD = 0.5
DAMPING = 1e-8  # of the Newton steps: enough to survive a singular posture, too little to be felt elsewhere
TURN = 2 * np.pi
TOOL_TIP = "tool_tip"


class _Drake(NamedTuple):
    """What is called so often that looking it up would take longer than the call."""

    matrix: Any
    angle_axis: Any
    by_velocity: Any


@cache
def _drake() -> _Drake:
    from pydrake.common.eigen_geometry import AngleAxis
    from pydrake.math import RotationMatrix
    from pydrake.multibody.tree import JacobianWrtVariable

    return _Drake(RotationMatrix, AngleAxis, JacobianWrtVariable.kV)


class NominalKinematics:
    """Drake's plant of a cell as drawn. Threads take turns.

    Args:
        spec: a robot or a cell; for a built-in robot its cell is taken.

    Attributes:
        name: of the arm's model.
        lower_rad, upper_rad: ``(6,)`` limits of the joints.
        home_rad: ``(6,)`` where the model stands by default.

    Raises:
        InputError: no such robot, or it has not six joints.
    """

    def __init__(self, spec: str | Path) -> None:
        self._lock = threading.RLock()
        self.plant = plants.load_plant(plants.cell_of(spec))
        self._arm = locate_arm(self.plant)
        if len(self._arm.joints) != 6:
            raise InputError(
                "a controller of Universal Robots drives six joints", expected="6", found=str(len(self._arm.joints))
            )
        self._context = self.plant.CreateDefaultContext()
        self._positions = self.plant.GetPositions(self._context).copy()
        self._index = [joint.position_start() for joint in self._arm.joints]
        self._velocity = [joint.velocity_start() for joint in self._arm.joints]
        self.name = self.plant.GetModelInstanceName(self._arm.instance)
        self.lower_rad = np.array([joint.position_lower_limits()[0] for joint in self._arm.joints])
        self.upper_rad = np.array([joint.position_upper_limits()[0] for joint in self._arm.joints])
        self.home_rad = self._positions[self._index].copy()

    def forward(self, q_rad: Array) -> Array:
        """``(4, 4)`` X_C0 at joints ``(6,)``."""
        with self._lock:
            self._set(q_rad)
            return self.plant.CalcRelativeTransform(self._context, self._arm.base, self._arm.flange).GetAsMatrix4()

    def inverse(self, X_C0: Array, q_near_rad: Array) -> Array | None:
        """Joints ``(6,)`` of the posture that Newton's method finds nearest to ``(6,)``; None where there is none."""
        found = self.followed(X_C0, q_near_rad)
        if found is not None and np.abs(found - q_near_rad).max() <= np.pi:
            return found
        dice = np.random.default_rng(0)
        starts = dice.uniform(-np.pi, np.pi, (MOST_STARTS, 6))
        others = [found, *(self.followed(X_C0, start) for start in starts)]
        near = [self._turned_towards(q, q_near_rad) for q in others if q is not None]
        return min(near, key=lambda q: float(np.linalg.norm(q - q_near_rad)), default=None)

    def followed(self, X_C0: Array, q_near_rad: Array) -> Array | None:
        """The same, by Newton's method from there alone: for short steps along a path."""
        with self._lock:
            q = np.array(q_near_rad, float)
            for _ in range(MOST_STEPS):
                error = _twist(self.forward(q), X_C0)
                if max(abs(error[3:])) < CLOSE_M and max(abs(error[:3])) < CLOSE_RAD:
                    q = np.where(q > self.upper_rad, q - TURN, np.where(q < self.lower_rad, q + TURN, q))
                    return q if (q >= self.lower_rad).all() and (q <= self.upper_rad).all() else None
                J = self._jacobian(np.zeros(3))
                step = J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(6), error)
                q += step * min(1.0, LARGEST_STEP_RAD / max(abs(step).max(), 1e-300))
            return None

    def jacobian(self, q_rad: Array, X_0T: Array) -> Array:
        """``(6, 6)`` from joint speeds to the tool's velocity in C: rotation in rad/s, then translation in m/s."""
        with self._lock:
            self._set(q_rad)
            return self._jacobian(X_0T[:3, 3])

    def joint_speeds(self, q_rad: Array, X_0T: Array, velocity: Array) -> Array:
        """``(6,)`` rad/s that move the tool as ``jacobian`` describes velocities; as near as can be where it cannot."""
        J = self.jacobian(q_rad, X_0T)
        return J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(6), velocity)

    def gravity_torques(self, q_rad: Array) -> Array:
        """``(6,)`` torques that hold the nominal arm, its tool included, against gravity, N m."""
        with self._lock:
            self._set(q_rad)
            return -self.plant.CalcGravityGeneralizedForces(self._context)[self._velocity]

    def up(self, q_rad: Array) -> Array:
        """``(3,)`` the direction against gravity, in 0."""
        with self._lock:
            self._set(q_rad)
            R_W0 = self._arm.flange.CalcRotationMatrixInWorld(self._context).matrix()
            return R_W0[2]

    def tool_on_it(self) -> tuple[float, Array, Array]:
        """What the cell has on its flange: mass, kg; centre ``(3,)`` in 0, m; X_0T of a frame ``tool_tip``, if any."""
        with self._lock:
            arm, plant = self._arm, self.plant
            carried = [body for body in plant.GetBodiesWeldedTo(arm.flange.body())]
            own = arm.flange.model_instance()
            bodies = [body.index() for body in carried if body.model_instance() != own]
            self._set(np.zeros(6))
            X_0T = np.eye(4)
            if plant.HasFrameNamed(TOOL_TIP):
                tip = plant.GetFrameByName(TOOL_TIP)
                X_0T = plant.CalcRelativeTransform(self._context, arm.flange, tip).GetAsMatrix4()
            if not bodies:
                return 0.0, np.zeros(3), X_0T
            inertia = plant.CalcSpatialInertia(self._context, arm.flange, bodies)
            return inertia.get_mass(), inertia.get_com(), X_0T

    def _turned_towards(self, q_rad: Array, q_near_rad: Array) -> Array:
        turned = q_rad + TURN * np.round((q_near_rad - q_rad) / TURN)
        turned = np.where(turned > self.upper_rad, turned - TURN, turned)
        return np.where(turned < self.lower_rad, turned + TURN, turned)

    def _set(self, q_rad: Array) -> None:
        self._positions[self._index] = q_rad
        self.plant.SetPositions(self._context, self._positions)

    def _jacobian(self, p_0T: Array) -> Array:
        arm = self._arm
        J = self.plant.CalcJacobianSpatialVelocity(
            self._context, _drake().by_velocity, arm.flange, p_0T, arm.base, arm.base
        )
        return J[:, self._velocity]


def rotation_vector(R: Array) -> Array:
    """``(3,)`` of a rotation matrix, by Drake."""
    matrix = _drake().matrix
    try:
        turn = matrix(R).ToAngleAxis()
    except RuntimeError:  # not quite a rotation after many products
        turn = matrix.ProjectToRotationMatrix(R).ToAngleAxis()
    return turn.angle() * turn.axis()


def rotation(vector: Array) -> Array:
    """``(3, 3)`` of a rotation vector, by Drake."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    drake = _drake()
    return drake.matrix(drake.angle_axis(angle, np.asarray(vector) / angle)).matrix()


def pose_matrix(pose: Sequence[float] | Array) -> Array:
    """``(4, 4)`` of six numbers."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = rotation(np.array(pose[3:], float)), pose[:3]
    return X


def pose_vector(X: Array) -> Array:
    """``(6,)`` of a ``(4, 4)``."""
    return np.concatenate([X[:3, 3], rotation_vector(X[:3, :3])])


def _twist(X_now: Array, X_goal: Array) -> Any:
    """``(6,)`` rotation and translation, in the frame of both, that lead from one to the other."""
    return np.concatenate([rotation_vector(X_goal[:3, :3] @ X_now[:3, :3].T), X_goal[:3, 3] - X_now[:3, 3]])
