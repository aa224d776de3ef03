"""The calibrated robot, and how far it is from where a program wants it, for rows of poses near programmed joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from truepath.kinematics import small_turns
from truepath.kinematics.blocks import blocks
from truepath.kinematics.chain_rows import ChainRows, cross
from truepath.lie import Array
from truepath.model import CalibratedModel, no_deviation

if TYPE_CHECKING:
    from truepath.kinematics.effect_rows import EffectRows

LEAST_TRACE = 2.96  # of the turn to the goal: 0.2 rad
LARGEST_TILT_RAD = 0.02


class ArmRows:
    """N poses of a calibrated robot at joints near the programmed ones.

    Args:
        model: the calibrated robot, with six joints or more.
        N: poses at a time.

    Attributes:
        miss: ``(6, N)`` rotation vector, rad, and shift, m, from where the flange is to where it should be, in B.
        valid: ``(N,)`` False where the joints are too far from the programmed ones for these numbers to be exact.
        errors: ``(n, N)`` of the joints, rad.
    """

    def __init__(self, model: CalibratedModel, N: int) -> None:
        n = model.robot.num_joints
        self._model = model
        self._nominal = ChainRows(model.robot, no_deviation(model.robot), N)
        self._chain = ChainRows(model.robot, model.p, N)
        self._angles = np.empty((3 * n, N))
        self._effects: EffectRows | None = None
        if model.effects:
            from truepath.kinematics.effect_rows import EffectRows, effect_programs  # casadi takes a while to import

            turn = tuple(self._chain.turn.tolist())
            self._effects = EffectRows(effect_programs(model.robot, model.effects, model.payload_kg, turn), N)
            self._angles = self._effects.angles
        self._X_BB, self._X_FF = model.goal_frames()
        self._moves_base, self._moves_flange = (not np.array_equal(X, np.eye(4)) for X in (self._X_BB, self._X_FF))
        self._start, self._waves = np.empty((2, n, N)), np.empty((2, n, N))
        self._true_start, self._true_waves = np.empty((2, n, N)), np.empty((2, n, N))
        self._scratch = np.empty((3, n, N))
        self._goal, self._wanted_tool = np.empty((4, 3, N)), np.zeros((3, N))
        self._q = np.empty((n, N))
        self._true_change, self._turn = np.empty((n, N)), np.empty((3, N))
        self.errors, self.miss = np.zeros((n, N)), np.empty((6, N))
        self.valid = np.ones(N, bool)

    def start(self, q_rad: Array) -> Array:
        """Sets programmed joints ``(N, n)``; nominal positions ``(3, N)`` of the flange there, m."""
        x, n = self._angles, len(self._q)
        self._q[...] = q_rad.T
        x[:n] = self._q
        np.sin(self._q, out=self._start[0])
        np.cos(self._q, out=self._start[1])
        x[n:] = self._start.reshape(2 * n, -1)
        _offset(self._start, self._nominal.offset, self._waves, self._scratch)
        self._nominal(self._waves)
        position = self._nominal.frame[3].copy()
        frame = self._nominal.frame
        self._goal[...] = frame
        for columns in blocks(x.shape[1]) if self._moves_base or self._moves_flange else ():
            part = frame[:, :, columns]
            if self._moves_flange:
                part = np.tensordot(self._X_FF.T, part, axes=1)
            if self._moves_base:
                part = np.matmul(self._X_BB[:3, :3], part)
                part[3] += self._X_BB[:3, 3, None]
            self._goal[:, :, columns] = part
        _pointed(self._goal, self._model.X_FE[:3, 3], self._wanted_tool)
        _offset(self._start, self._chain.offset, self._true_start, self._scratch)
        return position

    def nominal_positions(self, change: Array) -> Array:
        """``(3, N)`` of the nominal flange, m, at joints changed by ``(n, N)`` from the programmed ones."""
        _offset(self._start, self._nominal.offset, self._true_waves, self._scratch)
        small_turns.turn_on(self._true_waves, change, self._waves, self._scratch)
        self._nominal(self._waves)
        return self._nominal.frame[3]

    def at(self, change: Array | None) -> None:
        """Works out everything at joints changed by ``(n, N)`` from the programmed ones; None changes nothing."""
        x, n, chain, effects = self._angles, len(self._q), self._chain, self._effects
        if change is not None:
            np.add(self._q, change, out=x[:n])
            small_turns.turn_on(self._start, change, x[n:].reshape(2, n, -1), self._scratch)
        turned = change
        motions, moves = None, []
        if effects is not None and effects.programs.moves_joints:
            effects()
            self.errors[...] = effects.motions[:, 0]
            turned = self.errors if change is None else np.add(self.errors, change, out=self._true_change)
            motions, moves = effects.motions, effects.programs.moved_axes
        self.valid[...] = True
        if turned is None:
            self._true_waves[...] = self._true_start
        else:
            far = np.abs(turned, out=self._scratch[0])
            if not far.max() <= small_turns.LARGEST_RAD:
                self.valid &= (far <= small_turns.LARGEST_RAD).all(axis=0)
            small_turns.turn_on(self._true_start, turned, self._true_waves, self._scratch)
        chain(self._true_waves, moves, motions)
        self._compare(bool(moves))

    def jacobian(self) -> Array:
        """``(n, 6, N)`` columns (angular, linear) of the rigid robot at the true angles of ``at``, in B, as floats."""
        chain, J = self._chain, np.empty((len(self._q), 6, self._q.shape[1]), np.float32)
        J[:, :3] = chain.axes
        np.subtract(chain.frame[3], chain.origins, out=chain.origins)
        a, b = chain.axes, chain.origins
        t, u, _ = self._scratch
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            np.multiply(a[:, i], b[:, j], t)
            J[:, 3 + k] = np.subtract(t, np.multiply(a[:, j], b[:, i], u), t)
        return J

    def tool_miss_m(self) -> Array:
        """``(N,)`` distance of the tool point from where it should be."""
        tool = small_turns.turned_by(-self._turn, self._wanted_tool)
        tool -= self.miss[3:]
        return np.sqrt(np.add.reduce(np.multiply(tool, tool, tool), axis=0))

    def _compare(self, axes_move: bool) -> None:
        chain, effects, residual = self._chain, self._effects, self._model.residual
        v, trace = small_turns.between(self._goal[:3], chain.frame[:3])
        self.valid &= trace > LEAST_TRACE
        p = chain.frame[3]
        if axes_move:
            moved = cross(chain.tilt, p, np.empty_like(p), np.empty_like(p))
            moved += chain.sway
            p = np.add(p, moved, out=moved)
            v = self._tilted(v, chain.tilt)
        if effects is not None and effects.programs.strain != 0.0:
            p = p + effects.programs.strain * chain.frame[3]
        if residual is not None:
            p, v = self._with_networks(p, v)
        np.subtract(self._goal[3], p, out=self.miss[3:])
        self.miss[:3] = small_turns.rotation_vector(v)
        self._turn = v

    def _tilted(self, v: Array, rotation_vector: Array) -> Array:
        """What is left of the turn to the goal once the flange has been turned by a rotation vector ``(3, N)``."""
        if not np.abs(rotation_vector).max() <= LARGEST_TILT_RAD:
            self.valid &= (np.abs(rotation_vector) <= LARGEST_TILT_RAD).all(axis=0)
        return small_turns.without(v, small_turns.from_rotation_vector(rotation_vector))

    def _with_networks(self, p: Array, v: Array) -> tuple[Array, Array]:
        """Flange position ``(3, N)`` and turn to the goal, with what the networks say about the probe."""
        residual = self._model.residual
        assert residual is not None
        shift = np.ascontiguousarray(residual.shift(self._angles[: len(self._q)].T).T)
        p_FE = self._model.X_FE[:3, 3] if residual.p_FE is None else residual.p_FE
        # The probe on the flange as it stands now, in B: as the goal has it, turned back by what is left to turn.
        arm = _pointed(self._goal, p_FE, np.empty_like(p))
        arm += small_turns.turned_by(-v, arm)
        turn = small_turns.from_rotation_vector(shift[3:])
        # The probe moves by the shift; the flange is carried about it.
        p = p + shift[:3] - small_turns.turned_by(turn, arm)
        return p, self._tilted(v, shift[3:])


def _pointed(frame: Array, p_F: Array, out: Array) -> Array:
    """``(3, N)`` a point of the flange seen from the flange's origin, in B, for frames ``(4, 3, N)``."""
    out[...] = 0.0
    for column, length in zip(frame, p_F.tolist(), strict=False):
        if length != 0.0:
            out += column * length
    return out


def _offset(waves: Array, offset: Array, out: Array, scratch: Array) -> None:
    """Sine and cosine ``(2, n, N)`` of angles to each of which a number ``(n,)`` was added."""
    sin, cos = waves
    s, c = np.sin(offset)[:, None], np.cos(offset)[:, None]
    np.multiply(sin, c, out[0])
    out[0] += np.multiply(cos, s, scratch[0])
    np.multiply(cos, c, out[1])
    out[1] -= np.multiply(sin, s, scratch[0])
