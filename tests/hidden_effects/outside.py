"""Causes that the library does not know: each is real somewhere, none is nearly what a named effect could do.

That is less usual than it seems. An elbow that goes off by where the shoulder is equals a wobble of the shoulder's
axis; a pedestal that tilts under the arm's weight is mostly a soft joint 2; so is a forearm that twists under the
wrist's weight mostly a soft joint 3. Whoever names those is not wrong, so such causes are not drawn.
"""

from __future__ import annotations

import numpy as np

from hidden_effects.cause import Cause, Part
from hidden_effects.library import direction
from hidden_effects.scene import field


def hose_package(rng):
    """The hoses along the forearm twist the wrist: joint 5 goes off by where joint 3 is."""
    cycles, phase = int(rng.integers(1, 4)), rng.uniform(0, 2 * np.pi)

    def motion(scene):
        return scene.turning(5, 1e-4 * np.cos(cycles * scene.q[:, 2] - phase))

    return _of_one("hose_package", motion, size=1e-4, most=2e-3)


def tracker_azimuth(rng):
    """The azimuth encoder of the tracker interpolates badly: several waves across the workspace."""
    waves, phase = int(rng.integers(10, 30)), rng.uniform(0, 2 * np.pi)

    def motion(scene):
        p = scene.p_ME
        error = 1e-5 * np.cos(waves * np.arctan2(p[:, 1], p[:, 0]) - phase)
        return scene.misread(error[:, None] * np.stack([-p[:, 1], p[:, 0], 0 * error], axis=1))

    return _of_one("tracker_azimuth", motion, size=1e-5)


def cyclic_distance(rng):
    """The distance meter of the tracker has a cyclic error, a wave every 25 to 60 cm."""
    length, phase = rng.uniform(0.25, 0.6), rng.uniform(0, 2 * np.pi)

    def motion(scene):
        distance = np.linalg.norm(scene.p_ME, axis=1, keepdims=True)
        return scene.misread(1e-4 * np.cos(2 * np.pi * distance / length - phase) * scene.p_ME / distance)

    return _of_one("cyclic_distance", motion, size=1e-4)


def breathing_zero(rng):
    """A cabinet's cooling cycles: the zero of a joint swings several times during the campaign."""
    joint, swings, phase = int(rng.integers(2, 4)), rng.uniform(6, 15), rng.uniform(0, 2 * np.pi)

    def motion(scene):
        return scene.turning(joint, 1e-4 * np.cos(2 * np.pi * swings * scene.progress - phase))

    return _of_one("breathing_zero", motion, ("time",), 1e-4)


def jumping_zero(rng):
    """A loose coupling: a joint's zero jumps back and forth at moments of its own choosing."""
    joint, jumps = int(rng.integers(2, 4)), np.sort(rng.uniform(0, 1, rng.integers(20, 36)))

    def motion(scene):
        return scene.turning(joint, 1e-4 * (-1.0) ** np.searchsorted(jumps, scene.progress))

    return _of_one("jumping_zero", motion, ("time",), 1e-4)


def sagging_hoses(rng):
    """Hoses that hang from the forearm pull at a wrist: joint 4 or 5 goes off by how steep the forearm is."""
    joint, cycles, phase = int(rng.integers(4, 6)), int(rng.integers(1, 3)), rng.uniform(0, 2 * np.pi)

    def motion(scene):
        return scene.turning(joint, 1e-4 * np.cos(cycles * (scene.q[:, 1] + scene.q[:, 2]) - phase))

    return _of_one("sagging_hoses", motion, size=1e-4, most=2e-3)


def misaligned_reflector(rng):
    """The mirrors of the reflector do not meet in its centre: its reading depends on where the beam comes from."""
    waves, side = int(rng.integers(2, 5)), direction(rng)

    def motion(scene):
        beam = scene.p_ME / np.linalg.norm(scene.p_ME, axis=1, keepdims=True)
        seen = np.arccos(np.einsum("kji,kj,i->k", scene.R_ME, beam, side))
        return scene.misread(1e-4 * np.cos(waves * seen)[:, None] * beam)

    return _of_one("misaligned_reflector", motion, size=1e-4)


def worn_nest(rng):
    """The nest of the reflector is worn to a wedge: weight that pulls the ball to one side lifts it."""
    side, lift = rng.permutation([np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])])

    def motion(scene):
        pull = np.einsum("kji,j,i->k", scene.R_ME, scene.down_M / np.linalg.norm(scene.down_M), side)
        return scene.slipping(1e-4 * pull[:, None] * lift)

    return _of_one("worn_nest", motion, size=1e-4)


MOST_NAMED = 0.08


def bases_of_library(scene, visible):
    """For each effect of the library, at each joint, what it could do at all."""
    return [visible.directions([field(scene, motion) for motion in motions]) for motions in _nameable(scene)]


def is_outside(cause, scene, visible, bases):
    """Whether no effect of the library, at one joint, would carry more than a few percent of the cause."""
    hidden = visible.part(field(scene, cause.motion(scene)))
    for basis in bases:
        left = 1 - np.sum((basis.T @ hidden) ** 2) / np.sum(hidden**2)
        by_chance = basis.shape[1] / len(scene)  # what has that many dimensions carries some of anything
        if 1 - left / (1 - by_chance) > MOST_NAMED:
            return False
    return True


def _nameable(scene):
    """Motions of each effect of the library at each joint, in its usual generality."""
    for joint in range(1, 7):
        angle, torque = scene.q[:, joint - 1], scene.gravity_torque[:, joint - 1]
        waves = [wave(k * angle) for k in range(1, 7) for wave in (np.cos, np.sin)]
        drifts = [np.exp(-scene.progress / tau) for tau in (0.1, 0.3, 1.0)]
        for family in ([angle], [torque], [np.sign(torque)], [scene.approach[:, joint - 1]], drifts, waves):
            yield [scene.turning(joint, error) for error in family]
        twists = np.eye(6)[[0, 1, 3, 4]]
        yield [scene.carrying(joint, np.outer(wave, twist)) for wave in waves[:6] for twist in twists]
    yield [scene.standing(np.outer(scene.progress**k, twist)) for k in (1, 2, 3) for twist in np.eye(6)]


def _of_one(name, motion, needs=(), size=1.0, most=np.inf):
    return Cause(name, (Part(motion, ((size, 0.0, most),), {"size": size}),), needs)


OUTSIDE = (
    hose_package,
    tracker_azimuth,
    cyclic_distance,
    breathing_zero,
    jumping_zero,
    sagging_hoses,
    misaligned_reflector,
    worn_nest,
)
