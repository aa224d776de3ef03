"""The causes of the design document's vocabulary, with formulas of our own."""

from __future__ import annotations

import numpy as np

from hidden_effects.cause import Cause, Part

ALL_JOINTS = (1, 2, 3, 4, 5, 6)


def some(rng, joints, most):
    """One to ``most`` of the joints."""
    return sorted(int(j) for j in rng.choice(joints, rng.integers(1, most + 1), replace=False))


def between(rng, least, most):
    """A size, small ones as likely as large ones."""
    return float(np.exp(rng.uniform(np.log(least), np.log(most))))


def sign(rng):
    return float(rng.choice([-1.0, 1.0]))


def transmission_error(rng):
    """A gear whose output waves against its input, some waves a turn; in up to three harmonics."""

    def part(joint):
        cycles = rng.choice(np.arange(1, 61), rng.integers(1, 4), replace=False)
        waves = [(int(k), between(rng, 15e-6, 300e-6), rng.uniform(0, 2 * np.pi)) for k in cycles]

        def motion(scene):
            angle = scene.q[:, joint - 1]
            return scene.turning(joint, sum(size * np.cos(k * angle - phase) for k, size, phase in waves))

        sizes = tuple((size, 15e-6, 300e-6) for _, size, _ in waves)
        return Part(motion, sizes, {f"wave of {k} cycles": size for k, size, _ in waves}, joint)

    return Cause("transmission_error", tuple(part(j) for j in some(rng, ALL_JOINTS, 3)), pose_only=True)


def joint_compliance(rng, joints=None, least=0.5e-5, most=8e-5):
    """Gears that yield to gravity."""

    def part(joint):
        softness = between(rng, least, most)

        def rivals(scene):  # without directions of arrival, play would rest on the side that gravity chooses
            return [scene.turning(joint, np.sign(scene.gravity_torque[:, joint - 1]))]

        return Part(
            lambda scene: scene.turning(joint, softness * scene.gravity_torque[:, joint - 1]),
            ((softness, least, most),),
            {"compliance": softness},
            joint,
            rivals,
        )

    joints = some(rng, (2, 3, 4, 5), 3) if joints is None else joints
    return Cause("joint_compliance", tuple(part(j) for j in joints), pose_only=True)


def backlash(rng, by_gravity=None):
    """Play: the output lags behind the motor by half the width, or hangs on the side to which gravity pulls."""
    by_gravity = rng.random() < 0.3 if by_gravity is None else by_gravity

    def part(joint):
        width = between(rng, 50e-6, 1500e-6)

        def motion(scene):
            if by_gravity:
                return scene.turning(joint, 0.5 * width * np.sign(scene.gravity_torque[:, joint - 1]))
            return scene.turning(joint, -0.5 * width * scene.approach[:, joint - 1])

        def rivals(scene):
            return [scene.turning(joint, scene.gravity_torque[:, joint - 1])] if by_gravity else []

        return Part(motion, ((width, 50e-6, 1500e-6),), {"width": width}, joint, rivals)

    joints = some(rng, (2, 3), 2) if by_gravity else some(rng, ALL_JOINTS, 3)
    needs, left_out = ((), ("approach",)) if by_gravity else (("approach",), ())
    return Cause("backlash", tuple(part(j) for j in joints), needs, left_out)


def encoder_scale(rng, joints=None):
    """A joint that turns a little more, or less, than it says."""

    def part(joint):
        scale = sign(rng) * between(rng, 3e-5, 5e-4)
        return Part(
            lambda scene: scene.turning(joint, scale * scene.q[:, joint - 1]),
            ((scale, 3e-5, 5e-4),),
            {"scale": scale},
            joint,
        )

    joints = some(rng, ALL_JOINTS, 2) if joints is None else joints
    return Cause("encoder_scale", tuple(part(j) for j in joints), pose_only=True)


def thermal_expansion(rng):
    """Links that grow with the temperature."""
    expansion = between(rng, 10e-6, 30e-6)

    def motion(scene):
        warmer = scene.temperature_c - scene.temperature_c[0]
        flange = scene.p_MF - scene.p_MJ[:, -1]
        total = scene.slipping(expansion * warmer[:, None] * np.einsum("kji,kj->ki", scene.R_ME, flange))
        for joint in ALL_JOINTS[1:]:  # the first sits on the base itself
            link = scene.p_MJ[:, joint - 1] - scene.p_MJ[:, joint - 2]
            push = expansion * warmer[:, None] * np.einsum("kji,kj->ki", scene.R_MJ[:, joint - 1], link)
            total += scene.carrying(joint, np.concatenate([np.zeros_like(push), push], axis=1))
        return total

    part = Part(motion, ((expansion, 10e-6, 30e-6),), {"expansion": expansion})
    return Cause("thermal_expansion", (part,), ("temperature",))


def warmup_drift(rng, joints=None, slowness=(0.1, 0.6)):
    """Joint zeros that creep while the robot warms up.

    Never that of joint 1 alone: its zero and a turning pedestal are one and the same motion.
    """
    tau = rng.uniform(*slowness)

    def part(joint):
        creep = sign(rng) * between(rng, 50e-6, 500e-6)
        return Part(
            lambda scene: scene.turning(joint, creep * -np.expm1(-scene.progress / tau)),
            ((creep, 50e-6, 500e-6),),
            {"creep": creep},
            joint,
        )

    joints = some(rng, ALL_JOINTS[1:], 3) if joints is None else joints
    return Cause("warmup_drift", tuple(part(j) for j in joints), ("time",))


def frame_drift(rng, by_step=None):
    """The tracker (about itself) or the pedestal (about the robot's foot) moves: slowly, or in one step."""
    by_step = rng.random() < 0.5 if by_step is None else by_step
    push = direction(rng) * between(rng, 0.05e-3, 0.5e-3)
    turn = direction(rng) * between(rng, 0.02e-3, 0.3e-3)
    about_tracker = rng.random() < 0.5
    moment, bend = rng.uniform(0.25, 0.75), rng.uniform(0.0, 1.0)

    def progress(scene):
        u = np.clip(scene.progress, 0.0, 1.0)  # it has come to rest by the end of the campaign
        if by_step:
            return (u > moment).astype(float)
        return (1 - bend) * u + bend * 0.5 * (1 - np.cos(np.pi * u))

    def motion(scene):
        pivot = np.zeros(3) if about_tracker else scene.p_MJ[0, 0]
        return scene.standing(np.outer(progress(scene), [*turn, *(push - np.cross(turn, pivot))]))

    def rivals(scene):  # the zero of joint 1 turns everything about the pedestal's axis too
        return [scene.turning(1, progress(scene))]

    sizes = ((np.linalg.norm(push), 0.05e-3, 0.5e-3), (np.linalg.norm(turn), 0.02e-3, 0.3e-3))
    stated = {"translation": sizes[0][0], "rotation": sizes[1][0]}
    return Cause("frame_drift", (Part(motion, sizes, stated, rivals=rivals),), ("time",))


def tool_shift(rng):
    """The reflector slips in its nest, once."""
    shift = direction(rng) * between(rng, 0.05e-3, 0.5e-3)
    moment = rng.uniform(0.2, 0.8)
    part = Part(
        lambda scene: scene.slipping((scene.progress > moment)[:, None] * shift),
        ((np.linalg.norm(shift), 0.05e-3, 0.5e-3),),
        dict(zip("xyz", shift, strict=True)),
    )
    return Cause("tool_shift", (part,), ("time",))


def axis_wobble(rng):
    """An axis that tilts, shifts or both as its own joint turns: a bearing's run-out."""

    def part(joint):
        cycles = int(rng.integers(1, 4))
        tilts, shifts = [(True, False), (False, True), (True, True)][rng.integers(3)]
        tilt, shift = tilts * between(rng, 30e-6, 300e-6), shifts * between(rng, 20e-6, 200e-6)
        roundness, phases = rng.uniform(-1, 1, 2), rng.uniform(0, 2 * np.pi, 2)

        def motion(scene):
            angle = cycles * scene.q[:, joint - 1]
            twist = np.zeros((len(scene), 6))
            for first, size, squeeze, phase in zip((0, 3), (tilt, shift), roundness, phases, strict=True):
                twist[:, first] = size * np.cos(angle - phase)
                twist[:, first + 1] = size * squeeze * np.sin(angle - phase)
            return scene.carrying(joint, twist)

        sizes = ((tilt, 30e-6, 300e-6),) * tilts + ((shift, 20e-6, 200e-6),) * shifts
        stated = {f"{name}, {cycles} a turn": size for name, size in (("tilt", tilt), ("shift", shift)) if size}
        return Part(motion, sizes, stated, joint)

    return Cause("axis_wobble", tuple(part(j) for j in some(rng, ALL_JOINTS, 2)), pose_only=True)


def measurement_scale(rng, least=1e-4):
    """A tracker that reads every length too long, or too short."""
    scale = sign(rng) * between(rng, least, 1e-3)
    part = Part(lambda scene: scene.misread(scale * scene.p_ME), ((scale, least, 1e-3),), {"scale": scale})
    return Cause("measurement_scale", (part,))


def direction(rng):
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


LIBRARY = {
    cause.__name__: cause
    for cause in (
        transmission_error,
        joint_compliance,
        backlash,
        encoder_scale,
        thermal_expansion,
        warmup_drift,
        frame_drift,
        tool_shift,
        axis_wobble,
    )
}
