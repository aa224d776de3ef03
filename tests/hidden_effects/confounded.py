"""Campaigns that cannot tell a cause from another one: nobody should try, and further poses should settle it."""

from __future__ import annotations

import numpy as np

from hidden_effects.campaign import campaign_at, ticking
from hidden_effects.cause import Cause, Part, fit_into
from hidden_effects.library import between, direction, encoder_scale, joint_compliance, sign, warmup_drift
from hidden_effects.robot import FRESH, pool
from hidden_effects.scene import field

INDISTINGUISHABLE = 2.5  # root of the chi-square that is left when the other cause did its best
LEAST_SOFT, MOST_SOFT = 2e-5, 6e-5  # rad/(N m)
POSTURE_HALF_WIDTH = np.radians(10.0)


def around_one_posture(rng, spec, is_free):
    """100 to 300 poses within 10 degrees of one posture, the arm stretched out so that gravity loads it."""
    for centre in rng.permutation(pool(spec)[:-FRESH]):
        if abs(np.cos(centre[1])) > 0.5 and abs(np.cos(centre[1] + centre[2])) > 0.5:
            near = centre + rng.uniform(-POSTURE_HALF_WIDTH, POSTURE_HALF_WIDTH, (400, 6))
            near = np.array([q for q in near if is_free(q)])
            if len(near) >= 100:
                near = near[: rng.integers(100, min(len(near), 300) + 1)]
                return campaign_at(rng, near, ticking(rng, len(near)))
    raise RuntimeError("the cell is too narrow")


def in_order(rng, spec, is_free, joint):
    """150 to 400 poses all over the cell, but one joint (from 1) goes steadily from one angle to another."""
    count = int(rng.integers(150, 401))
    q = None
    while q is None:
        span = np.radians(rng.uniform(120, 200))
        start = rng.uniform(-np.pi, np.pi - span)
        q = _with_joint_at(rng, pool(spec)[:-FRESH], is_free, joint, start + span * np.linspace(0, 1, count))
    pace = rng.uniform(8.0, 15.0)
    time_s = pace * np.arange(count) + np.concatenate([[0.0], np.round(rng.uniform(0.0, 0.5, count - 1), 1)])
    return campaign_at(rng, q, time_s)


def _with_joint_at(rng, poses, is_free, joint, angles):
    """One of the poses for each angle of a joint, free of collision although it was turned there; None if none is."""
    visited = []
    for angle in angles:
        for pose in rng.choice(poses, 100, replace=False):
            pose[joint - 1] = angle
            if is_free(pose):
                visited.append(pose)
                break
        else:
            return None
    return np.array(visited)


def soft_arm(rng, scene, visible):
    """A compliance of joints 2 and 3 that this campaign takes for geometry; None if it would see it."""
    smallest = joint_compliance(rng, (2, 3), LEAST_SOFT, LEAST_SOFT)
    seen = visible.strength(field(scene, smallest.motion(scene)))
    if seen > INDISTINGUISHABLE:
        return None
    most = min(MOST_SOFT, LEAST_SOFT * INDISTINGUISHABLE / seen)
    cause = joint_compliance(rng, (2, 3), LEAST_SOFT, most)
    return cause if visible.strength(field(scene, cause.motion(scene))) < INDISTINGUISHABLE else None


SWEPT_JOINTS = {"frame_drift": (1,), "warmup_drift": (2, 3), "encoder_scale": (2, 3, 4, 5)}


def time_or_angle(rng, effect, joint):
    """What time and the angle of the swept joint could both have done, and the motions of the other explanation."""
    if effect == "frame_drift":
        return settling_pedestal(rng), lambda scene: _waves(scene, joint) + _wobbles(scene)
    if effect == "warmup_drift":
        return warmup_drift(rng, (joint,), (0.2, 0.6)), lambda scene: _waves(scene, joint)
    return encoder_scale(rng, (joint,)), lambda scene: _drifts(scene, joint)


def confused(rng, scene, visible, effect, joint):
    """A cause that this sweep of a joint cannot tell from its rival, though something is clearly there; or None."""
    cause, rivals = time_or_angle(rng, effect, joint)
    cause = fit_into(cause, scene, visible, rng, 1.0, 5.0)
    if cause is None:
        return None
    others = [field(scene, motion) for motion in rivals(scene)]
    return cause if visible.strength(field(scene, cause.motion(scene)), others) < INDISTINGUISHABLE else None


def settling_pedestal(rng):
    """The pedestal leans and slides more and more, until it rests."""
    lean, slide = (direction(rng)[:2] for _ in range(2))
    lean *= between(rng, 0.02e-3, 0.3e-3) / np.linalg.norm(lean)
    slide *= between(rng, 0.05e-3, 0.5e-3) / np.linalg.norm(slide)
    bend = sign(rng) * rng.uniform(0.0, 0.5)

    def motion(scene):
        u = np.clip(scene.progress, 0.0, 1.0)
        return scene.carrying(1, np.outer(u + bend * u * (1 - u), [*lean, 0.0, *slide, 0.0]))

    sizes = ((np.linalg.norm(slide), 0.05e-3, 0.5e-3), (np.linalg.norm(lean), 0.02e-3, 0.3e-3))
    stated = {"translation": sizes[0][0], "rotation": sizes[1][0]}
    return Cause("frame_drift", (Part(motion, sizes, stated),), ("time",))


def _waves(scene, joint):
    angle = scene.q[:, joint - 1]
    errors = [angle, *(wave(k * angle) for k in (1, 2, 3) for wave in (np.cos, np.sin))]
    return [scene.turning(joint, error) for error in errors]


def _wobbles(scene):
    waves = [wave(k * scene.q[:, 0]) for k in (1, 2, 3) for wave in (np.cos, np.sin)]
    return [scene.carrying(1, np.outer(wave, twist)) for wave in waves for twist in np.eye(6)[[0, 1, 3, 4]]]


def _drifts(scene, joint):
    return [
        scene.turning(joint, scene.progress),
        *(scene.turning(joint, np.exp(-scene.progress / t)) for t in (0.3, 1)),
    ]
