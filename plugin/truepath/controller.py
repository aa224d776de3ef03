"""What the robot's own controller believes its kinematics to be: the meaning of ``p[x, y, z, rx, ry, rz]``.

Frames: B truepath's robot base, F its flange; C the controller's base, 0 its tool flange, T tool.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from truepath import inverse, lie, ur_models
from truepath.controller_files import read_calibration_conf, read_extracted_kinematics
from truepath.errors import InputError
from truepath.inverse import InverseSolution
from truepath.lie import Array
from truepath.model import nominal_flange_poses, nominal_model
from truepath.robot import NominalRobot
from truepath.ur_models import AtZero

NOMINAL = "nominal"
SAME_M, SAME_RAD = 1e-6, 1e-6
MAX_MISFIT_M, MAX_MISFIT_RAD = 0.02, 0.1
# A plant may call "base" what the controller does, or that turned by pi about z, as ROS does (base_link).
BASES = (np.diag([1.0, 1.0, 1.0, 1.0]), np.diag([-1.0, -1.0, 1.0, 1.0]))


@dataclass(frozen=True, eq=False)
class Controller:
    """The controller's kinematics and how its frames lie in truepath's.

    Attributes:
        kinematics: the arm as the controller knows it, from C to 0: its "base" is C and its "flange" is 0.
        X_BC: ``(4, 4)`` the controller's base in the robot base.
        X_F0: ``(4, 4)`` the controller's tool flange in the flange.
        source: where this knowledge comes from, in words.
    """

    kinematics: NominalRobot
    X_BC: Array
    X_F0: Array
    source: str

    def tool_poses(self, q_rad: Array, X_0T: Array) -> Array:
        """``(N, 4, 4)`` poses X_CT that the controller reports at joints ``(N, n)``; X_0T ``(4, 4)`` or one each."""
        return nominal_flange_poses(self.kinematics, q_rad) @ X_0T

    def joints(self, X_CT: Array, X_0T: Array, q_near_rad: Array) -> InverseSolution:
        """The joints near ``(N, n)`` with which the controller puts the tool at ``(N, 4, 4)``.

        Newton's method from there: right for small differences. Which posture a controller takes for a pose further
        off is a matter of ``postures``.
        """
        forward = nominal_model(self.kinematics).flange_poses_and_jacobian
        return inverse.solve(forward, X_CT @ lie.invert(X_0T), q_near_rad)


def poses_from_vectors(vectors: Array) -> Array:
    """``(N, 4, 4)`` poses from ``(N, 6)`` x, y, z (m) and rotation vector (rad), as URScript writes ``p[...]``."""
    vectors = np.asarray(vectors, float)
    return lie.make_pose(lie.from_rotation_vector(vectors[..., 3:]), vectors[..., :3])


def vectors_from_poses(poses: Array) -> Array:
    """``(N, 6)`` x, y, z (m) and rotation vector (rad, at most pi long) from poses ``(N, 4, 4)``."""
    return np.concatenate([poses[..., :3, 3], lie.rotation_vector(poses[..., :3, :3])], axis=-1)


def controller_of(robot: NominalRobot, kinematics: str | Path = NOMINAL) -> Controller:
    """What the controller of a robot believes.

    Args:
        robot: as the plant has it.
        kinematics: ``nominal``: for a Universal Robot the published Denavit-Hartenberg parameters, for any other arm
            the plant itself. Or a ``.conf`` (calibration.conf of the controller) or a ``.yaml`` (extracted from it by
            the ROS driver's ur_calibration).

    Raises:
        InputError: the file is bad, or does not fit this robot.
    """
    model, X_BC = _model_of(robot)
    if str(kinematics) == NOMINAL:
        if model is None:
            return Controller(robot, np.eye(4), np.eye(4), f"the plant of {robot.name}")
        return _controller(robot, ur_models.chain(ur_models.published(model)), model, X_BC, f"{model} as published")
    path = Path(kinematics)
    if model is None:
        raise InputError(
            "only a Universal Robot has such a file",
            file=path,
            expected="a plant with the published kinematics of " + ", ".join(ur_models.LENGTHS_M),
            found=robot.name,
        )
    if path.suffix == ".conf":
        deltas = read_calibration_conf(path)
        arms = {name: ur_models.chain(ur_models.published(name) + deltas) for name in ur_models.LENGTHS_M}
    elif path.suffix in (".yaml", ".yml"):
        arms = dict.fromkeys(ur_models.LENGTHS_M, read_extracted_kinematics(path))
    else:
        raise InputError(
            "unknown kind of file",
            file=path,
            expected=f"{NOMINAL!r}, a calibration.conf or the .yaml of ur_calibration",
            found=path.suffix or "no suffix",
        )
    _refuse_another_robot(arms, model, path, absolute=path.suffix != ".conf")
    return _controller(robot, arms[model], model, X_BC, f"{model} as calibrated in {path.name}")


def _model_of(robot: NominalRobot) -> tuple[str | None, Array]:
    """Which Universal Robot this is, and X_BC. Compared at random joints, the flange being wherever it is."""
    if robot.num_joints == 6:
        q = np.random.default_rng(0).uniform(-np.pi, np.pi, (20, 6))
        own = nominal_flange_poses(robot, q)
        for model in ur_models.LENGTHS_M:
            arm = ur_models.chain(ur_models.published(model))
            for X_BC in BASES:
                controller = _controller(robot, arm, model, X_BC, "")
                theirs = X_BC @ nominal_flange_poses(controller.kinematics, q) @ lie.invert(controller.X_F0)
                error = np.abs(lie.pose_error(own, theirs))
                if (error[:, :3] < SAME_RAD).all() and (error[:, 3:] < SAME_M).all():
                    return model, X_BC
    return None, np.eye(4)


def _controller(robot: NominalRobot, arm: AtZero, model: str, X_BC: Array, source: str) -> Controller:
    """The robot with the axes of another arm, seen from C. X_F0 is that of the model as published."""
    X_CB = lie.invert(X_BC)
    X_F0 = lie.invert(robot.X_BF) @ X_BC @ ur_models.chain(ur_models.published(model)).X_C0
    z = arm.X_CA[:, :3, 2]
    # The point of each axis nearest to the joint: parameters of nearly parallel axes put theirs metres away.
    joint = robot.X_BA[:, :3, 3] @ X_CB[:3, :3].T + X_CB[:3, 3]
    origin = arm.X_CA[:, :3, 3]
    point = origin + z * np.einsum("ij,ij->i", joint - origin, z)[:, None]
    helper = np.eye(3)[np.argmin(np.round(np.abs(z), 6), axis=1)]
    x = helper - z * np.einsum("ij,ij->i", helper, z)[:, None]
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    kinematics = replace(
        robot,
        X_BA=lie.make_pose(np.stack([x, np.cross(z, x), z], axis=2), point),
        X_BF=arm.X_C0,
        p_BoLcm_B=robot.p_BoLcm_B @ X_CB[:3, :3].T + X_CB[:3, 3],
        gravity_B=X_CB[:3, :3] @ robot.gravity_B,
        X_WB=robot.X_WB @ X_BC,
        X_FR=None if robot.X_FR is None else lie.invert(X_F0) @ robot.X_FR,
    )
    return Controller(kinematics, X_BC, X_F0, source)


def _refuse_another_robot(arms: dict[str, AtZero], model: str, path: Path, *, absolute: bool) -> None:
    """Raises unless the arm of this model is near the published one; a file of absolute places also to no other nearer.

    Small deltas fit every model: a ``calibration.conf`` tells only by the large ones that cancel for one size of arm.
    """
    fits = {name: ur_models.misfit(ur_models.chain(ur_models.published(name)), arm) for name, arm in arms.items()}
    own = fits[model]
    near = {name: fit for name, fit in fits.items() if fit.distance_m < MAX_MISFIT_M and fit.angle_rad < MAX_MISFIT_RAD}
    nearer = [name for name, fit in near.items() if absolute and fit.distance_m < own.distance_m]
    if model not in near or nearer:
        others = ", ".join(nearer or near)
        raise InputError(
            "the file does not fit the robot",
            file=path,
            expected=f"a {model}: every axis and the flange within {1e3 * MAX_MISFIT_M:g} mm and "
            f"{MAX_MISFIT_RAD:g} rad of the published ones, with all joints at zero",
            found=f"{own.part} {1e3 * own.distance_m:.1f} mm and {own.angle_rad:.3f} rad away"
            + (f"; it would fit {others}" if others else ""),
        )
