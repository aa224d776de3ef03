"""A robot with every effect that moves a joint, an axis or a length, at most of its joints."""

import numpy as np
from truepath.effects.base import EffectParameter, FittedTerm, Term
from truepath.model import CalibratedModel
from truepath.motions import Moves

WARM = {"reference_c": 22.0, "default temperature_c": 27.0}
CREPT = {"tau_s": 50.0, "start": 0.0, "end": 200.0, "default time_s": 200.0}


def term(effect, moves, joint, reading, constants, *values):
    """A fitted term; values are pairs of a parameter's name and its size."""
    parameters = tuple(EffectParameter(name, "any", 1e-4, "any") for name, _ in values)
    inputs = (reading,) if reading else ()
    numbers = np.array([value for _, value in values])
    return FittedTerm(Term(effect, moves, joint, inputs, tuple(constants.items()), parameters), numbers)


def every_effect(num_joints, *, lower_rad=-4.0, upper_rad=4.0, seed=0):
    """Waves of neighbouring and of distant orders, half waves, polynomials, loads, wobble and more; sizes at random."""
    rng, covered = np.random.default_rng(seed), {"lower_rad": lower_rad, "upper_rad": upper_rad}
    shapes = (
        [f"{wave} {k}" for k in (1, 2, 3, 4, 7, 40) for wave in ("cos", "sin")],
        ["sin 3", "cos 11", "cos 12"],
        [f"half-wave {m}" for m in range(1, 14)],
        [f"chebyshev {d}" for d in range(1, 10)],
    )

    def sized(names, scale):
        return [(name, scale * rng.normal()) for name in names]

    terms = []
    for joint in range(1, num_joints + 1):
        names = shapes[joint % len(shapes)]
        terms += [
            term("transmission_error", Moves.JOINT, joint, "theta", covered, *sized(names, 2e-5)),
            term("encoder_scale", Moves.JOINT, joint, "theta", covered, *sized(["scale"], 1e-4)),
            term("warmup_drift", Moves.JOINT, joint, "time_s", CREPT, *sized(["creep"], 1e-4)),
        ]
        if joint in (1, 3, 4):
            names = [
                f"{c} {wave} {k}" for k in (1, 2, 3) for c in ("x", "y", "z", "rx", "ry") for wave in ("cos", "sin")
            ]
            terms.append(term("axis_wobble", Moves.AXIS, joint, "theta", covered, *sized(names, 2e-5)))
        if joint in (2, 3, 4):
            soft = {**covered, "soft_torque": 0.5}
            terms.append(term("joint_compliance", Moves.JOINT, joint, "gravity_torque", covered, ("compliance", 1e-5)))
            terms.append(term("backlash", Moves.JOINT, joint, "gravity_torque", soft, ("width", 2e-4)))
    terms.append(term("backlash", Moves.JOINT, 1, "approach", {}, ("width", 1e-4)))
    terms.append(term("thermal_expansion", Moves.ROBOT_LENGTHS, None, "temperature_c", WARM, ("expansion", 2e-5)))
    terms.append(term("measurement_scale", Moves.MEASURED_LENGTHS, None, "", {}, ("scale", 1e-4)))
    return tuple(terms)


def afflicted(robot, *, seed=0, size=3e-4, **more):
    """A calibration with deviations of every axis and every effect."""
    n, rng = robot.num_joints, np.random.default_rng(seed)
    p = np.concatenate([size * rng.normal(size=4 * n), np.zeros(12)])
    X_FE = np.eye(4)
    X_FE[:3, 3] = 0.05, -0.02, 0.13
    options = {"effects": every_effect(n, seed=seed), "payload_kg": 2.0, **more}
    return CalibratedModel(robot, p, np.eye(4), X_FE, np.eye(4), X_FE, **options)
