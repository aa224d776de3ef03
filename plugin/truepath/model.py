"""The robot that really stands in the cell: nominal kinematics plus what was learnt about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from truepath import lie, poe
from truepath.context import Context, as_context
from truepath.lie import Array
from truepath.motions import AROUND_THE_ROBOT, BEFORE_THE_FLANGE, ChainPoses, Moves
from truepath.robot import NominalRobot

if TYPE_CHECKING:
    from truepath.effects.base import FittedTerm
    from truepath.residual.ensemble import NetworkResidual


@dataclass(frozen=True, eq=False)
class CalibratedModel:
    """Predicts where the real robot goes. Frames: M measurement, B base, F flange, E probe.

    Attributes:
        robot: nominal robot.
        p: ``(4 n + 12,)`` deviations as in ``poe``; the steps of the frames are zero, being part of X_MB, X_FE.
        X_MB, X_FE: ``(4, 4)`` estimated base and probe frame.
        X_MB_nominal, X_FE_nominal: ``(4, 4)`` the same for the nominal robot: as stated, or its best fit.
        base_is_given, tool_is_given: whether that nominal frame was stated.
        effects: causes of error with their sizes; those that depend on a joint's angle fade out beyond the angles
            that were measured.
        payload_kg: carried during the measurements, beyond what the robot's model carries; assumed where a context
            names no payload.
        residual: networks for what has no name; fades out where the data did not reach.
    """

    robot: NominalRobot
    p: Array
    X_MB: Array
    X_FE: Array
    X_MB_nominal: Array
    X_FE_nominal: Array
    base_is_given: bool = False
    tool_is_given: bool = False
    effects: tuple[FittedTerm, ...] = ()
    payload_kg: float = 0.0
    residual: NetworkResidual | None = None

    def true_joints(self, poses: Array | Context) -> Array:
        """``(N, n)`` angles that the joints really take for commands ``(N, n)``."""
        context = self._context(poses)
        if not self.effects:
            return context.q_rad
        from truepath.effects import joint_errors  # casadi takes a while to import and rigid models need none

        return context.q_rad + joint_errors(self.robot, context, self.effects)

    def flange_poses(self, poses: Array | Context) -> Array:
        """``(N, 4, 4)`` poses X_BF of the real flange in the real base for commanded joints ``(N, n)``."""
        context = self._context(poses)
        phi = self.true_joints(context)
        if self._moved(BEFORE_THE_FLANGE):
            chain = ChainPoses.of(self.robot, self.p, phi, np.eye(4), np.eye(4))
            X_BF = self._shifted(chain.X_ME, context, chain, BEFORE_THE_FLANGE)
        else:
            X_BF = poe.flange_poses(self.robot, self.p, phi)
        return X_BF if self.residual is None else self._with_residual(X_BF, self.residual.shift(context.q_rad))

    def _with_residual(self, X_BF: Array, shift: Array) -> Array:
        """The flange such that the probe on it is shifted and turned by ``(N, 6)``, m and rad, in B."""
        assert self.residual is not None
        X_FE = self.X_FE if self.residual.p_FE is None else lie.make_pose(translation=self.residual.p_FE)
        X_BE = X_BF @ X_FE
        X_BE[:, :3, 3] += shift[:, :3]
        X_BE[:, :3, :3] = lie.from_rotation_vector(shift[:, 3:]) @ X_BE[:, :3, :3]
        return X_BE @ lie.invert(X_FE)

    def with_residual(self, residual: NetworkResidual) -> CalibratedModel:
        """The same with networks that have learnt what it leaves, for the probe that it has now."""
        return replace(self, residual=replace(residual, p_FE=self.X_FE[:3, 3]))

    def flange_poses_and_jacobian(self, q_rad: Array) -> tuple[Array, Array]:
        """The same and its Jacobian ``(N, 6, n)`` (angular, linear velocity of the flange origin, in B).

        The Jacobian is that of the rigid robot at the true angles: effects and networks change it by a few parts in a
        thousand.
        """
        X_BF, jacobian = poe.flange_poses_and_jacobian(self.robot, self.p, self.true_joints(q_rad))
        as_it_is = self.residual is None and not self._moved(BEFORE_THE_FLANGE)
        return (X_BF if as_it_is else self.flange_poses(q_rad)), jacobian

    def predict(self, poses: Array | Context) -> Array:
        """``(N, 4, 4)`` poses X_ME of the probe that a tracker would see.

        Poses without a time are those of today: whatever crept, moved or slipped during the measurements is where
        it was last.
        """
        X_MF = self.X_MB @ self.flange_poses(poses)
        X_ME = X_MF @ self.X_FE
        if not self._moved(AROUND_THE_ROBOT):
            return X_ME
        chain = ChainPoses(self.X_MB, X_MF[:, None], X_MF, X_ME)
        return self._shifted(X_ME, self._context(poses), chain, AROUND_THE_ROBOT)

    def _context(self, poses: Array | Context) -> Context:
        context = as_context(poses)
        return replace(context, payload_kg=self.payload_kg) if context.payload_kg is None else context

    def _moved(self, kinds: tuple[Moves, ...]) -> bool:
        return any(part.term.moves in kinds for part in self.effects)

    def _shifted(self, X: Array, context: Context, chain: ChainPoses, kinds: tuple[Moves, ...]) -> Array:
        from truepath.effects import probe_shift

        shift = probe_shift(self.robot, context, self.effects, chain, kinds)
        X = X.copy()
        X[:, :3, 3] += shift[:, :3]
        X[:, :3, :3] = lie.from_rotation_vector(shift[:, 3:]) @ X[:, :3, :3]
        return X

    def predict_nominal(self, poses: Array | Context) -> Array:
        """``(N, 4, 4)`` poses X_ME of the probe if the robot were as its maker drew it."""
        return self.X_MB_nominal @ nominal_flange_poses(self.robot, as_context(poses).q_rad) @ self.X_FE_nominal

    def frames_now(self) -> tuple[Array, Array]:
        """X_MB and X_FE ``(4, 4)`` as they were last, with whatever moved them during the measurements."""
        if not self._moved((Moves.BASE, Moves.PROBE)):
            return self.X_MB, self.X_FE
        from truepath.effects import probe_shift

        X_MB, X_FE = self.X_MB.copy(), self.X_FE.copy()
        # A probe at the origin of the frame that moves, carried by nothing that turns: its shift is the frame's.
        here = np.eye(4)[None]
        for X, kind in ((X_MB, Moves.BASE), (X_FE, Moves.PROBE)):
            chain = ChainPoses(np.eye(4), here[:, None], here, here)
            shift = probe_shift(self.robot, Context(np.zeros((1, self.robot.num_joints))), self.effects, chain, (kind,))
            step = lie.make_pose(lie.from_rotation_vector(shift[:, 3:])[0], shift[0, :3])
            X[:] = X @ step if kind is Moves.BASE else _moved_in_place(X, step)
        return X_MB, X_FE

    def goal_flange_poses(self, X_BF_programmed: Array) -> Array:
        """Where the real flange must be, in the real base, for the tool to be where the program means it.

        A program is written for the nominal robot. If its place in the measurement frame was stated, the
        tool shall arrive at its programmed place there, although the base stands a little elsewhere; if
        nobody knows that place, the estimated base is the only one there is. Likewise for the probe on the
        flange: against a stated mounting, an offset of the probe is an offset of the flange.

        Args, Returns:
            ``(N, 4, 4)``.
        """
        X_BB, X_FF = self.goal_frames()
        return X_BB @ X_BF_programmed @ X_FF

    def goal_frames(self) -> tuple[Array, Array]:
        """``(4, 4)`` each, what ``goal_flange_poses`` multiplies a programmed flange pose with, left and right."""
        X_MB, X_FE = self.frames_now()
        X_BB = lie.invert(X_MB) @ self.X_MB_nominal if self.base_is_given else np.eye(4)
        X_FF = self.X_FE_nominal @ lie.invert(X_FE) if self.tool_is_given else np.eye(4)
        return X_BB, X_FF


def _moved_in_place(X_FE: Array, step: Array) -> Array:
    """The probe shifted along, and turned about, the axes of the flange."""
    X = X_FE.copy()
    X[:3, :3] = step[:3, :3] @ X[:3, :3]
    X[:3, 3] += step[:3, 3]
    return X


def nominal_flange_poses(robot: NominalRobot, q_rad: Array) -> Array:
    """``(N, 4, 4)`` flange poses X_BF of the nominal robot."""
    return poe.flange_poses(robot, no_deviation(robot), q_rad)


def no_deviation(robot: NominalRobot) -> Array:
    """The parameter vector of a perfect robot."""
    return np.zeros(4 * robot.num_joints + 12)


def nominal_model(robot: NominalRobot, X_MB: Array | None = None, X_FE: Array | None = None) -> CalibratedModel:
    """A robot without any deviation, for comparison."""
    X_MB = np.eye(4) if X_MB is None else X_MB
    X_FE = np.eye(4) if X_FE is None else X_FE
    return CalibratedModel(robot, no_deviation(robot), X_MB, X_FE, X_MB, X_FE)
