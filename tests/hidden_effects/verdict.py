"""Asking for a diagnosis of a CSV, and what its verdict is worth once the truth is known.

A verdict is the content of ``diagnosis.json`` as the design document has it, read in again from JSON.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np
from truepath.plants import load_robot
from truepath.readers import read_measurements

NO_CAUSE = ("unexplained",)  # nobody is sent to repair that
WITHIN = 1.959964  # sigmas that a 95 % interval reaches to either side
PHYSICAL = {
    "joint_compliance": ("compliance",),
    "encoder_scale": ("scale",),
    "backlash": ("width",),
    "thermal_expansion": ("expansion",),
    "tool_shift": ("x", "y", "z"),
}


def diagnose_csv(spec, csv, plan=False):
    """The diagnosis of a CSV text, with what to measure next or without, and its verdict as others read it."""
    from truepath.diagnose import diagnose

    robot = load_robot(spec)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "data.csv"
        path.write_text(csv)
        measurements = read_measurements(path, robot)
    diagnosis = diagnose(robot, measurements, spec=spec, plan=plan)
    return diagnosis, json.loads(json.dumps(diagnosis.to_dict(), allow_nan=False))


def named(verdict, truth):
    """Effect to joints of everything that the findings name; outliers are no wrong name where there are some."""
    ignored = {*NO_CAUSE, *(["outlier"] if truth.outlier_rows else [])}
    effects = {}
    for finding in verdict["findings"]:
        if finding["effect"] not in ignored:
            effects.setdefault(finding["effect"], set()).update(finding["joints"] or ())
    return {effect: tuple(sorted(joints)) for effect, joints in effects.items()}


def names_the_truth(verdict, truth):
    """Whether every hidden effect is named with its joints, and nothing else is."""
    found = named(verdict, truth)
    with_joints = {effect: joints for effect, joints in truth.effects.items() if joints}
    return set(found) == set(truth.effects) and all(found[e] == joints for e, joints in with_joints.items())


def finds_the_outliers(verdict, truth):
    """Whether all wrong rows are listed, and at most one good row in a hundred."""
    listed = set(verdict["data"]["outliers"])
    return set(truth.outlier_rows) <= listed and len(listed) - len(truth.outlier_rows) <= 0.01 * truth.poses


def says_unexplained(verdict, truth):
    """Whether structure is said to be left, and nothing is named for it."""
    return verdict["unexplained"]["structured"] is True and not named(verdict, truth)


def says_ambiguous(verdict, truth):
    """Whether the hidden effect stands among those that cannot be told apart, and nothing is named."""
    (effect,) = truth.effects
    return not named(verdict, truth) and any(effect in entry["effects"] for entry in verdict["ambiguous"])


def is_resolved(verdict, truth):
    """Whether the hidden effect is named with its joints, and is no longer in doubt."""
    (effect,) = truth.effects
    return names_the_truth(verdict, truth) and all(effect not in entry["effects"] for entry in verdict["ambiguous"])


def poses_to_measure(diagnosis, truth):
    """``(k, n)`` the poses that would settle what the hidden effect is, None if no such poses are offered."""
    (effect,) = truth.effects
    offers = [entry.poses for entry in diagnosis.ambiguous if effect in entry.effects and entry.poses is not None]
    return np.concatenate(offers) if offers else None


def intervals(verdict, truth):
    """``(name, truth, value, sigma)`` of the physical parameters of effects that were named correctly."""
    rows = []
    for finding in verdict["findings"]:
        effect = finding["effect"]
        joints = truth.effects.get(effect)
        if joints is None or (joints and named(verdict, truth)[effect] != joints):
            continue
        for parameter in finding["parameters"]:
            key = (effect, parameter["name"], parameter["joint"])
            if parameter["name"] in PHYSICAL.get(effect, ()) and key in truth.parameters:
                rows.append((key, truth.parameters[key], parameter["value"], parameter["sigma"]))
    return rows


def covers(effect, truth, value, sigma):
    """Whether a 95 % interval holds the truth; the sign of a play is a matter of convention."""
    error = abs(value) - abs(truth) if effect == "backlash" else value - truth
    return abs(error) <= WITHIN * sigma


def true_gain_mm(diagnosis, case):
    """By how much the findings lower the mean error on 5000 poses that nobody has seen."""
    q, p = case.fresh()
    kinematic, final = (diagnosis.seen_models[name].predict(q)[:, :3, 3] for name in ("kinematic", "final"))
    return 1e3 * float(np.mean(np.linalg.norm(kinematic - p, axis=1) - np.linalg.norm(final - p, axis=1)))
