"""The verdict in one sentence, and what could not be tested."""

from __future__ import annotations

import numpy as np

from truepath.context import Context
from truepath.diagnosis import Diagnosis, NotTestable
from truepath.effects import EFFECTS
from truepath.robot import NominalRobot


def verdict(diagnosis: Diagnosis) -> str:
    """What a reader must know, in one sentence."""
    stages = {stage.model: stage.accuracy.position_mm.mean for stage in diagnosis.stages}
    kinematic, left, floor = stages["kinematic"], diagnosis.unexplained.heldout_mm, diagnosis.unexplained.noise_floor_mm
    text = f"Calibrating the kinematics lowers the mean error from {stages['nominal']:.3f} to {kinematic:.3f} mm"
    if diagnosis.findings:
        causes = _list([_with_joints(f.effect, f.joints) for f in diagnosis.findings])
        text += f"; {causes} {'explains' if len(diagnosis.findings) == 1 else 'explain'} more, down to {left:.3f} mm"
    else:
        text += "; no other cause is proved by these data"
    if diagnosis.unexplained.structured:
        text += "; what is left has a pattern that no known cause carries"
    else:
        text += f"; what is left looks like noise, of which {floor:.3f} mm are expected"
    text += _networks(diagnosis)
    real = [item for item in diagnosis.ambiguous if "measurement_scale" not in item.effects]
    if real:
        groups = [
            " from ".join([_plain(item.effects[0]), _list([_plain(e) for e in item.effects[1:]], "or")])
            for item in real
        ]
        text += f"; these data do not tell {'; nor '.join(groups)}"
    return text + "."


def _networks(diagnosis: Diagnosis) -> str:
    """What became of them, where they were asked for."""
    network = diagnosis.network
    if network is None:
        return ""
    if network.model is None or network.gain is None:
        return "; networks are left out, as nothing proves that they would help"
    before, after = network.gain.before_mm, network.gain.after_mm
    return f"; networks for what has no name take the mean error from {before:.3f} to {after:.3f} mm"


def not_testable(robot: NominalRobot, context: Context) -> list[NotTestable]:
    """Effects that the data cannot test for want of a column, or because nothing varied."""
    found = []
    for name, effect in EFFECTS.items():
        missing = effect.missing(context)
        if missing:
            found.append(NotTestable(name, missing, f"nobody recorded {_list(list(missing))}"))
        elif name != "measurement_scale" and not effect.terms(robot, context):
            columns = effect.needs or tuple(f"q{i + 1}_rad" for i in range(robot.num_joints))
            found.append(
                NotTestable(name, columns, f"{_list(list(columns))} hardly varied, or there are too few poses")
            )
    offered = {term.joint: term.inputs for term in EFFECTS["backlash"].terms(robot, context)}
    blind = [joint for joint in range(1, robot.num_joints + 1) if joint not in offered]
    guessed = [joint for joint, inputs in offered.items() if inputs != ("approach",)]
    if context.approach is None or not np.any(context.approach):
        joints = _list([str(joint) for joint in blind])
        why = "the direction of arrival was not recorded"
        if blind and guessed:
            place = f"joint{'s' if len(blind) > 1 else ''} {joints}"
            why += f": backlash of {place} cannot be seen, that of the others only by the side gravity pulls to"
        found = [item for item in found if item.effect != "backlash"]
        found.append(NotTestable("backlash", tuple(f"approach{i + 1}" for i in range(robot.num_joints)), why))
    return found


def _with_joints(effect: str, joints: tuple[int, ...]) -> str:
    if not joints:
        return _plain(effect)
    return f"{_plain(effect)} of joint{'s' if len(joints) > 1 else ''} {_list([str(joint) for joint in joints])}"


def _plain(name: str) -> str:
    return name.replace("_", " ").replace("kinematic", "geometry")


def _list(parts: list[str], last: str = "and") -> str:
    return ", ".join(parts[:-1]) + f" {last} {parts[-1]}" if len(parts) > 1 else "".join(parts)
